"""Reads an MCAP log that `tumble convert` or `tumble simulate --mcap` wrote with the Python library `mcap`, and compares it with the CSV it was made of.

Not needed to build or test. Needs Python 3.11 with `pip install mcap==1.6.0`; run as

    python mcap_reread.py LOG.mcap LOG.csv

Every cell of the CSV must be in the file, bit for bit, under its stamp, and nothing else; check sums and the index are
checked, no chunk may span more than a second, and each message may only have the fields that its schema lists.
"""
import json
import sys

from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.records import Chunk

SOURCES = {"true": "true_", "commanded": "cmd_", "estimated": "est_", "sigma": "sigma_", "measured": ""}


def check_fields(value, schema, where):
    if schema.get("type") == "array":
        for item in value:
            check_fields(item, schema["items"], where)
    elif schema.get("type") == "object" and "properties" in schema:
        assert set(value) == set(schema["properties"]), (where, sorted(value), sorted(schema["properties"]))
        for name, item in value.items():
            check_fields(item, schema["properties"][name], f"{where}.{name}")
    elif schema.get("type") == "number":
        assert isinstance(value, float), (where, value)
    elif schema.get("type") == "integer":
        assert isinstance(value, int), (where, value)
    elif schema.get("type") == "string":
        assert isinstance(value, str), (where, value)


def stamp(time):
    return time["sec"] * 10**9 + time["nsec"]


def nanoseconds(text):
    whole, _, fraction = text.partition(".")
    return int(whole) * 10**9 + int(fraction.ljust(9, "0"))


mcap, csv = sys.argv[1:]
found, kinds, world = {}, {}, {}
with open(mcap, "rb") as file:
    reader = make_reader(file, validate_crcs=True)
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        content = json.loads(message.data)
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        check_fields(content, json.loads(schema.data), channel.topic)
        kinds[schema.name] = kinds.get(schema.name, 0) + 1
        if channel.topic == "/world":
            assert (message.log_time, content["deletions"]) == (0, []), channel.topic
            scene = {entity.pop("id"): entity for entity in content["entities"]}
            assert list(scene) == ["keep_in", "keep_out", "obstacles"], list(scene)
            for name, entity in scene.items():
                assert (stamp(entity["timestamp"]), entity["frame_id"], stamp(entity["lifetime"])) == (0, "world", 0)
                solids = entity.pop("spheres" if name == "obstacles" else "cubes")
                assert not any(value for value in entity.values() if isinstance(value, list)), name
                for solid in solids:
                    assert min(solid["size"].values()) > 0, (name, solid)
                    assert abs(sum(q * q for q in solid["pose"]["orientation"].values()) - 1) < 1e-12, (name, solid)
                    assert all(0 <= part <= 1 for part in solid["color"].values()), (name, solid)
                world[name] = solids
            continue
        row = found.setdefault(message.log_time, {})
        if channel.topic == "/tf":
            (transform,) = content["transforms"]
            assert stamp(transform["timestamp"]) == message.log_time
            assert (transform["parent_frame_id"], transform["child_frame_id"]) == ("world", "body")
            assert list(transform["translation"].values()) == [row[k] for k in ("p_x", "p_y", "p_z")]
            assert list(transform["rotation"].values()) == [row[k] for k in ("q_x", "q_y", "q_z", "q_w")]
            continue
        _, source, what = channel.topic.split("/")
        prefix = SOURCES[source]
        if what == "pose":
            assert (stamp(content["timestamp"]), content["frame_id"]) == (message.log_time, "world")
            cells = {f"{prefix}p_{k}": v for k, v in content["pose"]["position"].items()}
            cells |= {f"{prefix}q_{k}": v for k, v in content["pose"]["orientation"].items()}
        elif what == "wrench":
            cells = {prefix + k: v for k, v in content.items()}
        else:
            cells = content
        assert not set(cells) & set(row), (channel.topic, message.log_time)
        row |= cells
    statistics = reader.get_summary().statistics
    assert statistics.message_count == sum(kinds.values()), statistics
with open(mcap, "rb") as file:
    chunks = [r for r in StreamReader(file, emit_chunks=True, validate_crcs=True).records if isinstance(r, Chunk)]
    longest = max(c.message_end_time - c.message_start_time for c in chunks)
    assert longest < 10**9, longest

with open(csv) as file:
    names = file.readline().strip().split(",")
    count = 0
    for line in file:
        row = dict(zip(names, line.strip().split(",")))
        time = nanoseconds(row.pop("t_s"))
        cells = {k: v for k, v in row.items() if v}
        written = found.pop(time)
        assert set(written) == set(cells), (time, set(written) ^ set(cells))
        for name, text in cells.items():
            assert float(text).hex() == float(written[name]).hex(), (time, name, text, written[name])
        count += len(cells)
assert not found
for name, solids in world.items():
    for solid in solids:
        print(name, *solid["pose"]["position"].values(), *solid["size"].values())
print(f"{count} cells equal to the bit; messages: {kinds}; {len(chunks)} chunks of at most {longest * 1e-9:.3f} s")

"""Writes the reference MCAP files of `tests/mcap.rs` and the values they hold.

Not needed to build or test. Needs Python 3.11 with `pip install mcap==1.6.0 rosbags==0.11.9 numpy lz4 zstandard`; run as

    python mcap_files.py FOLDER

with FOLDER = `crates/astrobee/tests/golden`. The container is written by `mcap` (MIT), the messages by rosbags (Apache-2.0);
neither shares anything with ours.
"""
import json
import sys
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_HUMBLE)
random = np.random.default_rng(5)
T = store.types


def vector(kind="geometry_msgs/msg/Vector3"):
    return T[kind](*random.normal(size=3).tolist())


def quaternion():
    q = random.normal(size=4)
    return T["geometry_msgs/msg/Quaternion"](*(q / np.linalg.norm(q)).tolist())


def header(stamp_ns, frame):
    stamp = T["builtin_interfaces/msg/Time"](stamp_ns // 10**9, stamp_ns % 10**9)
    return T["std_msgs/msg/Header"](stamp, frame)


def pose():
    return T["geometry_msgs/msg/Pose"](vector("geometry_msgs/msg/Point"), quaternion())


def covariance(count):
    # Mostly zeros, as flown ones are.
    values = np.zeros(count)
    values[:: int(count**0.5) + 1] = random.random(int(count**0.5))
    return values


def message(kind, stamp_ns):
    if kind == "nav_msgs/msg/Odometry":
        twist = T["geometry_msgs/msg/Twist"](vector(), vector())
        return T[kind](
            header(stamp_ns, "odom"),
            "base_link",
            T["geometry_msgs/msg/PoseWithCovariance"](pose(), covariance(36)),
            T["geometry_msgs/msg/TwistWithCovariance"](twist, covariance(36)),
        )
    if kind == "geometry_msgs/msg/PoseStamped":
        return T[kind](header(stamp_ns, "world \u00b5"), pose())
    if kind == "geometry_msgs/msg/WrenchStamped":
        return T[kind](header(stamp_ns, "body"), T["geometry_msgs/msg/Wrench"](vector(), vector()))
    if kind == "sensor_msgs/msg/Imu":
        return T[kind](header(stamp_ns, "imu"), quaternion(), covariance(9), vector(), covariance(9), vector(), covariance(9))
    return T[kind]("of no interest")


def values(item):
    """The numbers and texts of a message one after the other; floats as text, to the bit."""
    if isinstance(item, (str, int)):
        return [item]
    if isinstance(item, float):
        return [repr(item)]
    if isinstance(item, np.ndarray):
        return [repr(float(x)) for x in item]
    if type(item).__name__.endswith("Time"):
        return [str(item.sec * 10**9 + item.nanosec)]
    return [v for name in item.__dataclass_fields__ if name != "__msgtype__" for v in values(getattr(item, name))]


TOPICS = [
    ("/odom", "nav_msgs/msg/Odometry"),
    ("/pose", "geometry_msgs/msg/PoseStamped"),
    ("/wrench", "geometry_msgs/msg/WrenchStamped"),
    ("/imu/data", "sensor_msgs/msg/Imu"),
    ("/chatter", "std_msgs/msg/String"),
]


def definition(kind):
    text, _ = store.generate_msgdef(kind, ros_version=2)
    # The reader does not look into it; short definitions keep the files small.
    return text.split("=" * 80)[0]


def main(folder):
    begin_ns = 1_700_000_000_000_000_123
    messages = []
    for step in range(3):
        for n, (topic, kind) in enumerate(TOPICS):
            stamp = begin_ns + step * 16_000_000 + n * 1_000
            # Every fourth is recorded late, after later ones.
            log = stamp + (40_000_000 if (step + n) % 4 == 0 else 2_000_000)
            messages.append((topic, kind, log, message(kind, stamp)))
    compressions = {"none": CompressionType.NONE, "lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}
    for name, compression in {**compressions, "unchunked": CompressionType.NONE}.items():
        with open(folder / f"ros2_{name}.mcap", "wb") as out:
            writer = Writer(
                out,
                chunk_size=1000,
                compression=compression,
                use_chunking=name != "unchunked",
                enable_data_crcs=name in ("none", "unchunked"),
                repeat_schemas=False,
                repeat_channels=False,
            )
            writer.start(profile="ros2", library="mcap 1.6.0 for Python")
            channels = {}
            for topic, kind in TOPICS:
                schema = writer.register_schema(name=kind, encoding="ros2msg", data=definition(kind).encode())
                channels[topic] = writer.register_channel(topic=topic, message_encoding="cdr", schema_id=schema)
            kept = messages if name in ("none", "lz4") else messages[:5]
            for topic, kind, log, item in kept:
                payload = bytes(store.serialize_cdr(item, kind))
                writer.add_message(channel_id=channels[topic], log_time=log, publish_time=log, data=payload)
            writer.add_metadata("about", {"provenance": "generate/mcap_files.py"})
            writer.finish()
    with open(folder / "ros2_messages.jsonl", "w") as out:
        out.write(json.dumps({"provenance": "written by generate/mcap_files.py: mcap 1.6.0 (MIT), rosbags 0.11.9 (Apache-2.0)"}) + "\n")
        for topic, kind, log, item in messages:
            line = {"topic": topic, "type": kind.replace("/msg/", "/"), "log_time_ns": log}
            out.write(json.dumps({**line, "values": values(item)}, separators=(",", ":")) + "\n")


main(Path(sys.argv[1]))

"""Reads the golden ULog, which `tests/suite/ulog.rs` writes from the specification, with the Python library `pyulog`, and writes what it finds.

Not needed to build or test. Needs Python 3.11 with `pip install pyulog==1.3.0`; run as

    python ulog_reread.py everything.ulg > everything_ulg.jsonl

The reader (BSD-3-Clause) shares nothing with ours. A line is a message: topic, instance, and every field by its path, without padding.
"""
import json
import sys

from pyulog import ULog

log = ULog(sys.argv[1])
messages = []
for topic in log.data_list:
    for row in range(len(topic.data["timestamp"])):
        fields = {path: float(column[row]) for path, column in topic.data.items() if "_padding" not in path}
        messages.append({"topic": topic.name, "instance": topic.multi_id, "fields": fields})
for message in sorted(messages, key=lambda message: message["fields"]["timestamp"]):
    print(json.dumps(message))

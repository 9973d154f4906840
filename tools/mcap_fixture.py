"""Writes tests/fixtures/mcap-lz4.mcap: two pressures as JSON, a second at 100 Hz, in chunks that Python's mcap library packed with lz4. Needs mcap and lz4."""

import json
from pathlib import Path

from mcap.writer import CompressionType, Writer

START_NS = 1_773_480_413_250_000_000

with open(Path(__file__).parent.parent / "tests/fixtures/mcap-lz4.mcap", "wb") as file:
    writer = Writer(file, chunk_size=2000, compression=CompressionType.LZ4)
    writer.start(profile="", library="tools/mcap_fixture.py")
    schema = writer.register_schema(name="Sample", encoding="jsonschema", data=b'{"type": "object"}')
    channel = writer.register_channel(topic="/daq", message_encoding="json", schema_id=schema)
    for i in range(100):
        message = {"p1_bar": 2.0 + 0.01 * i, "p2_bar": 1.5}
        time_ns = START_NS + i * 10_000_000
        writer.add_message(channel, log_time=time_ns, publish_time=time_ns, sequence=i, data=json.dumps(message).encode())
    writer.finish()

#!/usr/bin/env python3
"""Watches a recording while it is made, with clients that share nothing with surgescope, and compares what they got with the file.

    python3 -m venv venv && venv/bin/pip install mcap protobuf websockets
    venv/bin/python tools/check_live.py target/debug/surgescope --rig rigs/demo-hdpe.toml --simulate --rate 20000 --duration 60

Starts `surgescope record` with the arguments and `--live`. One client takes everything; one subscribes to everything and never reads; one, by
the library `websockets`, decodes by the schema that it was sent, and tries to publish; pages of strange origins and a rebound name are turned
away. In the end the file must have every sample that was asked for, and the first client the file's messages, byte by byte and in order. It may
lack only those that the program says it dropped, as it does where a client, or a busy computer, is too slow.
Exit code 0 when all agrees, 1 with what does not.
"""

import asyncio
import base64
import json
import os
import re
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from array import array

import websockets
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader

SUBPROTOCOL = "foxglove.sdk.v1"
# The server's last frame: it goes away, and says why.
FAREWELL = b"\x88\x17\x03\xe9the recording is over"


class Mismatch(Exception):
    """Something is not as it should be."""


def expect(condition, message):
    if not condition:
        raise Mismatch(message)


def shake_hands(port, **headers):
    """A socket after the handshake, and the answer's head."""
    head = {
        "Host": f"127.0.0.1:{port}",
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": base64.b64encode(os.urandom(16)).decode(),
        "Sec-WebSocket-Protocol": SUBPROTOCOL,
    }
    head |= {name.replace("_", "-"): value for name, value in headers.items()}
    lines = "".join(f"{name}: {value}\r\n" for name, value in head.items() if value is not None)
    line = socket.create_connection(("127.0.0.1", port), timeout=30)
    line.sendall(f"GET / HTTP/1.1\r\n{lines}\r\n".encode())
    answer = b""
    while b"\r\n\r\n" not in answer:
        more = line.recv(1)
        expect(more, f"the connection ended within the answer {answer!r}")
        answer += more
    return line, answer.decode()


def masked(opcode, payload):
    """A client's frame."""
    mask = os.urandom(4)
    length = bytes([0x80 | len(payload)]) if len(payload) < 126 else b"\xfe" + struct.pack(">H", len(payload))
    return bytes([0x80 | opcode]) + length + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(payload))


def frames(data):
    """The frames of a server's stream: opcode and payload; what is left at the end."""
    at = 0
    while at + 2 <= len(data):
        opcode, length, start = data[at] & 0x0F, data[at + 1], at + 2
        if length == 126:
            length, start = struct.unpack_from(">H", data, start)[0], start + 2
        elif length == 127:
            length, start = struct.unpack_from(">Q", data, start)[0], start + 8
        if start + length > len(data):
            break
        yield opcode, data[start : start + length]
        at = start + length


class Taker(threading.Thread):
    """A client that subscribes to every channel that is advertised, and keeps all that comes."""

    def __init__(self, port):
        super().__init__()
        self.line, answer = shake_hands(port)
        expect(" 101 " in answer and f"sec-websocket-protocol: {SUBPROTOCOL}" in answer.lower(), answer)
        self.got = bytearray()
        self.closed = False

    def run(self):
        looked_at, names = 0, {}
        while True:
            try:
                more = self.line.recv(1 << 20)
            except OSError:
                return
            if not more:
                return
            self.got += more
            # texts are rare: only the start of what came is searched for advertised channels, until all sensors are there
            if b'"advertise"' in more or looked_at < 100:
                looked_at += 1
                for opcode, payload in frames(bytes(self.got)):
                    if opcode != 1:
                        continue
                    said = json.loads(payload)
                    for channel in said.get("channels", []):
                        if channel["id"] not in names:
                            names[channel["id"]] = channel
                            wanted = {"id": 1000 + channel["id"], "channelId": channel["id"]}
                            self.line.sendall(masked(1, json.dumps({"op": "subscribe", "subscriptions": [wanted]}).encode()))
            if self.got.endswith(FAREWELL):
                self.closed = True
                self.line.sendall(masked(8, struct.pack(">H", 1000)))

    def messages(self):
        """The channels, and what came of each: see [`Stream`]."""
        channels, streams = {}, {}
        for opcode, payload in frames(bytes(self.got)):
            if opcode == 1:
                for channel in json.loads(payload).get("channels", []):
                    channels[1000 + channel["id"]] = channel
            elif opcode == 2:
                kind, subscription, log_time = struct.unpack_from("<BIQ", payload)
                expect(kind == 1, f"a message of kind {kind}")
                if subscription not in streams:
                    streams[subscription] = Stream(log_time)
                streams[subscription].add(payload[5:])
        return list(channels.values()), {channels[id]["topic"]: stream for id, stream in streams.items()}


class Stream:
    """The messages of a topic: log time and data of each, one behind the other, with where each ends."""

    def __init__(self, first_ns):
        self.first_ns, self.bytes, self.ends = first_ns, bytearray(), array("Q", [0])

    def add(self, message):
        self.bytes += message
        self.ends.append(len(self.bytes))

    def __len__(self):
        return len(self.ends) - 1

    def __iter__(self):
        return (self.bytes[start:end] for start, end in zip(self.ends, self.ends[1:]))


def never_reads(port):
    """A client that subscribes to the first channels and reads nothing more."""
    line, answer = shake_hands(port)
    expect(" 101 " in answer, answer)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    got = b""
    while b'"advertise"' not in got:
        got += line.recv(4096)
    wanted = [{"id": i, "channelId": i} for i in range(0, 9, 3)]
    line.sendall(masked(1, json.dumps({"op": "subscribe", "subscriptions": wanted}).encode()))
    return line


def refused(port, **headers):
    line, answer = shake_hands(port, **headers)
    line.close()
    expect(re.match(r"HTTP/1.1 4\d\d ", answer), f"{headers} was let in: {answer}")


async def by_the_library(port):
    """Decodes some samples by the schema that came with the channel, and tries to publish."""
    async with websockets.connect(f"ws://127.0.0.1:{port}", subprotocols=[SUBPROTOCOL], max_size=None) as line:
        info = json.loads(await line.recv())
        expect(info["op"] == "serverInfo" and info["capabilities"] == [], f"not only to watch: {info}")
        channels = json.loads(await line.recv())["channels"]
        channel = channels[0]
        pool = descriptor_pool.DescriptorPool()
        for file in descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"])).file:
            pool.Add(file)
        decode = message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"])).FromString
        await line.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 5, "channelId": channel["id"]}]}))
        await line.send(json.dumps({"op": "advertise", "channels": [{"id": 1, "topic": channel["topic"], "encoding": "protobuf"}]}))
        await line.send(b"\x01" + struct.pack("<I", 1) + b"not mine")
        statuses, values = [], []
        while len(values) < 100 or len(statuses) < 2:
            said = await line.recv()
            if isinstance(said, str):
                statuses.append(json.loads(said))
            else:
                values.append(decode(said[13:]))
        expect(all(status["op"] == "status" and "only shows" in status["message"] for status in statuses), f"{statuses}")
        return [value.value for value in values if hasattr(value, "value")]


def of_the_file(path):
    """What each channel says of itself, and what it has: see [`Stream`]."""
    schemas, channels, streams = {}, {}, {}
    with open(path, "rb") as file:
        for record in StreamReader(file).records:
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                topic = channels[record.channel_id].topic
                if topic not in streams:
                    streams[topic] = Stream(record.log_time)
                streams[topic].add(struct.pack("<Q", record.log_time) + record.data)
    said = {c.topic: (schemas[c.schema_id].name, schemas[c.schema_id].data, c.metadata) for c in channels.values()}
    return said, streams


def compare(taker, path):
    """What came, message by message, against the file: how many came, and how many are missing since the client came on."""
    live_channels, live = taker.messages()
    file_channels, filed = of_the_file(path)
    for channel in live_channels:
        name, data, metadata = file_channels[channel["topic"]]
        expect(channel["schemaName"] == name and base64.b64decode(channel["schema"]) == data, f"another schema of {channel['topic']}")
        expect(channel["metadata"] == metadata, f"other metadata: {channel['metadata']}, {metadata}")
    expect(live.keys() == filed.keys(), f"live {sorted(live)}, in the file {sorted(filed)}")
    came, missing = 0, 0
    for topic, whole in filed.items():
        got, rest = live[topic], iter(whole)
        first = next(iter(got))
        before = next(i for i, message in enumerate(whole) if message == first)
        expect(all(message in rest for message in got), f"{topic}: what came live is not in the file, or in another order")
        missed_s = (got.first_ns - whole.first_ns) / 1e9
        expect(missed_s < 5, f"{topic}: the first message came {missed_s} s late")
        print(f"{topic}: {len(got)} of {len(whole)} messages, each as in the file; the client came {missed_s:.2f} s after the first")
        came, missing = came + len(got), missing + len(whole) - before - len(got)
    return came, missing


def main():
    program, *arguments = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "run.mcap")
        command = [program, "record", *arguments, "--live", "127.0.0.1:0", "-o", path, "--json"]
        said, told = open(os.path.join(folder, "out"), "w+"), open(os.path.join(folder, "err"), "w+")
        recorder = subprocess.Popen(command, stdout=said, stderr=told)
        deadline = time.monotonic() + 60
        port = None
        while port is None:
            expect(recorder.poll() is None and time.monotonic() < deadline, open(told.name).read())
            found = re.search(r"live at ws://127.0.0.1:(\d+)", open(told.name).read())
            port = found and int(found[1])
            time.sleep(0.02)
        taker = Taker(port)
        taker.start()
        sleeper = never_reads(port)
        for origin in ["https://evil.example", "null", "https://app.foxglove.dev.evil.example"]:
            refused(port, Origin=origin)
        refused(port, Host=f"evil.example:{port}")
        refused(port, Sec_WebSocket_Protocol="chat")
        values = asyncio.run(by_the_library(port))
        print(f"{len(values)} samples decoded by their schema: {min(values, default=0):.6g} to {max(values, default=0):.6g}")
        _, status, used = os.wait4(recorder.pid, 0)
        taker.join()
        sleeper.close()
        code = os.waitstatus_to_exitcode(status)
        expect(code == 0, f"exit code {code}: {open(told.name).read()}")
        summary = json.load(open(said.name))
        expect(taker.closed, "the client was not told of the end")
        total, missing = compare(taker, path)
        live = summary["live"]
        expect(missing <= live["dropped"], f"{missing} messages did not come, and not all were counted: {live}")
        print(f"{missing} messages were dropped on the way to the client that reads")
        expect(live["clients"] == 3, f"{live}")
        # the system keeps some megabytes for a client that does not read
        expect(live["dropped"] > 0 or total < 1_000_000, f"a client that never reads has lost nothing: {live}")
        expect(not summary["data_lost"] and all(s["gaps"] == 0 for s in summary["sensors"]), f"{summary}")
        expect("evil.example" in json.dumps(summary["warnings"]), f"nothing was said of the strangers: {summary['warnings']}")
        for sensor in summary["sensors"]:
            print(f"{sensor['name']}: {sensor['samples']} samples recorded, {sensor['gaps']} gaps")
        print(f"{total} messages live; live: {live}; {summary['duration_s']:.1f} s recorded")
        print(f"the recorder took {used.ru_utime + used.ru_stime:.1f} s of a core, {used.ru_maxrss / 1024:.0f} MiB")


if __name__ == "__main__":
    try:
        main()
    except Mismatch as error:
        sys.exit(f"{error}")

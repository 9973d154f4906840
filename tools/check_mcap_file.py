#!/usr/bin/env python3
"""Checks that MCAP files are built as the specification says (mcap.dev/spec), as `mcap doctor` does and further.

    python3 -m venv venv && venv/bin/pip install mcap mcap-protobuf-support
    venv/bin/python tools/check_mcap_file.py run.mcap …

Every check sum is computed anew, every offset, length, count and time of an index is compared with what stands in the file. Records are
parsed by Python's mcap package, schemas by protobuf; nothing is shared with surgescope. Exit code 0 when all is right, 1 with a
sentence on the first thing that is not.
check_mcap_damage.py shows that it refuses what is wrong.
"""

import io
import sys
import zlib
from collections import Counter, defaultdict, namedtuple

import zstandard
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, unknown_fields
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode

MAGIC = b"\x89MCAP0\r\n"
PREFIX = 9  # opcode and length before each record
TYPES = {opcode: getattr(records, "".join(word.title() for word in opcode.name.split("_"))) for opcode in Opcode}
IN_CHUNKS = {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE}
IN_DATA = {Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT, Opcode.METADATA, *IN_CHUNKS}
IN_SUMMARY = {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX}

# A record with where it stands: `start` of its opcode, `end` behind its body.
Placed = namedtuple("Placed", "opcode start end body value")


class Broken(Exception):
    """The file is not as the specification says."""


def expect(condition, message):
    if not condition:
        raise Broken(message)


def walk(data, start, end, where):
    """The records between two places, each parsed."""
    while start < end:
        expect(start + PREFIX <= end, f"{where}: half a record at byte {start}")
        length = int.from_bytes(data[start + 1 : start + PREFIX], "little")
        stop = start + PREFIX + length
        expect(stop <= end, f"{where}: the record at byte {start} is longer than what is left")
        expect(data[start] in TYPES, f"{where}: no record has the opcode {data[start]} (byte {start})")
        opcode, body = Opcode(data[start]), data[start + PREFIX : stop]
        stream = ReadDataStream(io.BytesIO(body))
        try:
            value = TYPES[opcode].read(stream, length) if opcode == Opcode.MESSAGE else TYPES[opcode].read(stream)
        except Exception as error:
            raise Broken(f"{where}: the {opcode.name} at byte {start} cannot be read: {error!r}") from error
        expect(stream.count == length, f"{where}: the {opcode.name} at byte {start} holds more than its fields")
        yield Placed(opcode, start, stop, body, value)
        start = stop


class File:
    """The parts of a file, taken apart by its footer."""

    def __init__(self, data):
        expect(data[: len(MAGIC)] == MAGIC, "the magic at the start is wrong")
        expect(data[-len(MAGIC) :] == MAGIC, "the magic at the end is wrong: the file is not finished")
        all_records = list(walk(data, len(MAGIC), len(data) - len(MAGIC), "the file"))
        expect(all_records, "there is nothing in the file")
        self.header, self.footer = all_records[0], all_records[-1]
        expect(self.header.opcode == Opcode.HEADER, "the first record is no header")
        expect(self.footer.opcode == Opcode.FOOTER, "the last record is no footer")
        ends = [i for i, r in enumerate(all_records) if r.opcode == Opcode.DATA_END]
        expect(len(ends) == 1, f"{len(ends)} records say that the data end")
        self.end = all_records[ends[0]]
        self.data_section = all_records[1 : ends[0]]
        self.summary = all_records[ends[0] + 1 : -1]
        self.bytes = data

    def of(self, opcode, records=None):
        return [r for r in (self.data_section if records is None else records) if r.opcode == opcode]


def check_frame(file, profile):
    """Header, the order of sections, the three check sums of the file as a whole."""
    header, footer = file.header.value, file.footer.value
    expect(header.profile == profile, f"the profile is {header.profile!r}, not {profile!r}")
    expect(header.library.strip(), "the header does not say which library wrote it")
    for record in file.data_section:
        expect(record.opcode in IN_DATA, f"a {record.opcode.name} does not belong before the data's end (byte {record.start})")
    crc = zlib.crc32(file.bytes[: file.end.start])
    expect(file.end.value.data_section_crc == crc, "the check sum of the data section is wrong")
    expect(footer.summary_start == file.end.end, "the footer's summary start is not behind the data")
    crc = zlib.crc32(file.bytes[footer.summary_start : file.footer.end - 4])
    expect(footer.summary_crc == crc, "the check sum of the summary is wrong")


def check_definitions(schemas, channels, record, where):
    """Takes a schema or channel; the same number means the same everywhere."""
    value = record.value
    known = schemas if record.opcode == Opcode.SCHEMA else channels
    expect(known.setdefault(value.id, value) == value, f"{where}: {record.opcode.name} {value.id} is defined in two ways")
    if record.opcode == Opcode.SCHEMA:
        expect(value.id != 0, f"{where}: a schema has the number 0")
    else:
        expect(value.schema_id in schemas, f"{where}: channel {value.topic} refers to schema {value.schema_id}, which is not there")


def check_chunks(file):
    """What is in the chunks, and their message indexes; returns schemas, channels and all messages."""
    schemas, channels, messages, chunks = {}, {}, [], []
    for place, record in enumerate(file.data_section):
        if record.opcode in IN_CHUNKS:
            raise Broken(f"a {record.opcode.name} outside any chunk (byte {record.start})")
        if record.opcode != Opcode.CHUNK:
            continue
        where, chunk = f"the chunk at byte {record.start}", record.value
        expect(chunk.compression in ("zstd", ""), f"{where} is compressed by {chunk.compression!r}")
        try:
            plain = zstandard.decompress(chunk.data, chunk.uncompressed_size) if chunk.compression else chunk.data
        except zstandard.ZstdError as error:
            raise Broken(f"{where} cannot be decompressed: {error}") from error
        expect(len(plain) == chunk.uncompressed_size, f"{where} holds {len(plain)} bytes, not {chunk.uncompressed_size}")
        expect(zlib.crc32(plain) == chunk.uncompressed_crc, f"{where}: its check sum is wrong")
        held = []
        for inner in walk(plain, 0, len(plain), where):
            expect(inner.opcode in IN_CHUNKS, f"{where}: a {inner.opcode.name} does not belong in it")
            if inner.opcode == Opcode.MESSAGE:
                expect(inner.value.channel_id in channels, f"{where}: a message of the channel {inner.value.channel_id}, not known yet")
                held.append(inner)
            else:
                check_definitions(schemas, channels, inner, where)
        times = [m.value.log_time for m in held] or [0]
        expect(
            (chunk.message_start_time, chunk.message_end_time) == (min(times), max(times)),
            f"{where}: its messages are from {min(times)} to {max(times)} ns, not {chunk.message_start_time} to {chunk.message_end_time}",
        )
        following = []
        for index in file.data_section[place + 1 :]:
            if index.opcode != Opcode.MESSAGE_INDEX:
                break
            following.append(index)
        check_message_indexes(following, held, where)
        messages += held
        chunks.append((record, following))
    indexes = sum(len(following) for _, following in chunks)
    expect(indexes == len(file.of(Opcode.MESSAGE_INDEX)), "a message index stands behind no chunk")
    return schemas, channels, messages, chunks


def check_message_indexes(indexes, held, where):
    wanted = defaultdict(list)
    for message in held:
        wanted[message.value.channel_id].append((message.value.log_time, message.start))
    found = {}
    for index in indexes:
        channel = index.value.channel_id
        expect(channel not in found, f"{where}: two message indexes of channel {channel}")
        found[channel] = index.value.records
    expect(set(found) == set(wanted), f"{where}: message indexes of the channels {sorted(found)} for messages of {sorted(wanted)}")
    for channel, entries in wanted.items():
        expect(
            sorted(found[channel]) == sorted(entries),
            f"{where}: the message index of channel {channel} does not point at its messages and their times",
        )


def check_summary(file, schemas, channels, messages, chunks):
    """The summary's copies, indexes and counts."""
    where = "the summary"
    for record in file.summary:
        expect(record.opcode in IN_SUMMARY | {Opcode.SUMMARY_OFFSET}, f"a {record.opcode.name} does not belong in {where}")
    for opcode, known in ((Opcode.SCHEMA, schemas), (Opcode.CHANNEL, channels)):
        copies = [r.value for r in file.of(opcode, file.summary)]
        expect(sorted(c.id for c in copies) == sorted(known), f"{where} has other {opcode.name} records than the chunks")
        expect(all(known[c.id] == c for c in copies), f"{where}: a {opcode.name} is not the one of the chunks")

    found = {r.value.chunk_start_offset: r.value for r in file.of(Opcode.CHUNK_INDEX, file.summary)}
    expect(len(found) == len(file.of(Opcode.CHUNK_INDEX, file.summary)), f"{where}: two indexes of one chunk")
    expect(set(found) == {chunk.start for chunk, _ in chunks}, f"{where}: the chunk indexes do not point at the chunks")
    for chunk, indexes in chunks:
        got, value = found[chunk.start], chunk.value
        wanted = records.ChunkIndex(
            chunk_start_offset=chunk.start,
            chunk_length=chunk.end - chunk.start,
            compression=value.compression,
            compressed_size=len(value.data),
            uncompressed_size=value.uncompressed_size,
            message_start_time=value.message_start_time,
            message_end_time=value.message_end_time,
            message_index_length=sum(i.end - i.start for i in indexes),
            message_index_offsets={i.value.channel_id: i.start for i in indexes},
        )
        expect_same(got, wanted, f"the index of the chunk at byte {chunk.start}")

    for opcode, source in ((Opcode.ATTACHMENT_INDEX, Opcode.ATTACHMENT), (Opcode.METADATA_INDEX, Opcode.METADATA)):
        found = {r.value.offset: r.value for r in file.of(opcode, file.summary)}
        sources = file.of(source)
        expect(len(found) == len(sources), f"{where}: {len(found)} {opcode.name} records for {len(sources)} of {source.name}")
        for record in sources:
            expect(record.start in found, f"{where}: no index points at the {source.name} at byte {record.start}")
            wanted = {"offset": record.start, "length": record.end - record.start, "name": record.value.name}
            if source == Opcode.ATTACHMENT:
                wanted |= {key: getattr(record.value, key) for key in ("log_time", "create_time", "media_type")}
                wanted["data_size"] = len(record.value.data)
            expect_same(found[record.start], TYPES[opcode](**wanted), f"the index of the {source.name} at byte {record.start}")

    statistics = file.of(Opcode.STATISTICS, file.summary)
    expect(len(statistics) == 1, f"{where}: {len(statistics)} records of statistics")
    times = [m.value.log_time for m in messages] or [0]
    wanted = records.Statistics(
        message_count=len(messages),
        schema_count=len(schemas),
        channel_count=len(channels),
        attachment_count=len(file.of(Opcode.ATTACHMENT)),
        metadata_count=len(file.of(Opcode.METADATA)),
        chunk_count=len(chunks),
        message_start_time=min(times),
        message_end_time=max(times),
        channel_message_counts=dict(Counter(m.value.channel_id for m in messages)),
    )
    got = statistics[0].value
    # a channel without messages may be counted, as 0
    got.channel_message_counts = {channel: n for channel, n in got.channel_message_counts.items() if n or channel not in channels}
    expect_same(got, wanted, "the statistics")


def expect_same(got, wanted, what):
    for key, value in vars(wanted).items():
        expect(getattr(got, key) == value, f"{what}: {key} is {getattr(got, key)}, but {value} in the file")


def check_summary_offsets(file):
    """Every group of the summary, and nothing else, is pointed at."""
    offsets = file.of(Opcode.SUMMARY_OFFSET, file.summary)
    groups = [r for r in file.summary if r.opcode != Opcode.SUMMARY_OFFSET]
    start = offsets[0].start if offsets else 0
    expect(file.footer.value.summary_offset_start == start, "the footer does not point at the summary offsets")
    expect(file.summary == groups + offsets, "the summary offsets are not the last of the summary")
    wanted = {}
    for record in groups:
        first, _ = wanted.get(record.opcode, (record.start, None))
        wanted[record.opcode] = (first, record.end)
    for opcode, (first, end) in wanted.items():
        expect(
            all(r.opcode == opcode for r in groups if first <= r.start < end),
            f"the {opcode.name} records of the summary do not stand together",
        )
    found = {o.value.group_opcode: (o.value.group_start, o.value.group_start + o.value.group_length) for o in offsets}
    expect(len(found) == len(offsets), "two summary offsets of one group")
    expect(found == {int(k): v for k, v in wanted.items()}, f"the summary offsets are {found}, not {wanted}")


def check_attachments(file):
    for record in file.of(Opcode.ATTACHMENT):
        crc = int.from_bytes(record.body[-4:], "little")
        expect(crc == zlib.crc32(record.body[:-4]), f"the check sum of the attachment {record.value.name} is wrong")


def check_schemas(schemas, channels, messages):
    """Each schema is a set of protobuf files with the message that it names, and all messages are of it."""
    types = {}
    for schema in schemas.values():
        expect(schema.encoding == "protobuf", f"schema {schema.name}: its encoding is {schema.encoding}")
        try:
            files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
            pool = descriptor_pool.DescriptorPool()
            for proto in files.file:
                pool.Add(proto)
            types[schema.id] = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
        except Exception as error:
            raise Broken(f"schema {schema.name} is no set of protobuf files with that message: {error}") from error
    for channel in channels.values():
        expect(channel.message_encoding == "protobuf", f"channel {channel.topic}: its messages are {channel.message_encoding}")
    topics = Counter(channel.topic for channel in channels.values())
    expect(all(n == 1 for n in topics.values()), "two channels have one topic")
    for message in messages:
        channel = channels[message.value.channel_id]
        try:
            decoded = types[channel.schema_id].FromString(message.value.data)
        except Exception as error:
            raise Broken(f"a message of {channel.topic} at {message.value.log_time} ns is not of its schema: {error}") from error
        expect(
            not len(unknown_fields.UnknownFieldSet(decoded)),
            f"a message of {channel.topic} at {message.value.log_time} ns has fields that its schema does not know",
        )


def check(data, profile="surgescope"):
    """Raises `Broken` for the first thing that is wrong; returns what there is, as one line."""
    file = File(data)
    check_frame(file, profile)
    schemas, channels, messages, chunks = check_chunks(file)
    check_attachments(file)
    check_summary(file, schemas, channels, messages, chunks)
    check_summary_offsets(file)
    check_schemas(schemas, channels, messages)
    return f"{len(messages)} messages of {len(channels)} channels in {len(chunks)} chunks, {len(data)} bytes"


def main(arguments):
    if not arguments:
        sys.exit(__doc__)
    for path in arguments:
        try:
            with open(path, "rb") as file:
                print(f"{path}: as the specification says: {check(file.read())}")
        except Broken as broken:
            print(f"{path}: {broken}", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

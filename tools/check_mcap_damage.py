"""Shows that check_mcap_file.py refuses what is wrong: it damages a copy of each file in memory in every way it knows.

    venv/bin/python tools/check_mcap_damage.py run.mcap …

Exit code 1 where a damage is overlooked.
"""

import io
import random
import re
import struct
import sys
import zlib

from google.protobuf import descriptor_pb2, wrappers_pb2
from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType, Writer

from check_mcap_file import MAGIC, PREFIX, Broken, File, check

FLIPS = 150
SUMMARY, DATA, ENDS = "summary", "data_section", "ends"

# Section, record, place of a byte in its body (from the end where negative) and the sentence that must come. Check sums are made right again.
FIELDS = [
    (ENDS, Opcode.HEADER, 4, "the profile is"),
    (ENDS, Opcode.FOOTER, 0, "summary start is not behind the data"),
    (ENDS, Opcode.FOOTER, 8, "the footer does not point at the summary offsets"),
    (DATA, Opcode.CHUNK, 0, "its messages are from"),
    (DATA, Opcode.CHUNK, 8, "its messages are from"),
    (DATA, Opcode.CHUNK, 16, "cannot be decompressed|holds .* bytes, not"),
    (DATA, Opcode.CHUNK, 24, "its check sum is wrong"),
    (DATA, Opcode.CHUNK, 32, "is compressed by"),
    (DATA, Opcode.MESSAGE_INDEX, 0, "message indexes of"),
    (DATA, Opcode.MESSAGE_INDEX, 6, "does not point at its messages"),
    (DATA, Opcode.MESSAGE_INDEX, 14, "does not point at its messages"),
    (DATA, Opcode.ATTACHMENT, -1, "the check sum of the attachment"),
    (SUMMARY, Opcode.SCHEMA, 6, "a SCHEMA is not the one of the chunks"),
    (SUMMARY, Opcode.SCHEMA, -1, "a SCHEMA is not the one of the chunks|cannot be read"),
    (SUMMARY, Opcode.CHANNEL, 8, "a CHANNEL is not the one of the chunks"),
    (SUMMARY, Opcode.STATISTICS, 0, "the statistics: message_count"),
    (SUMMARY, Opcode.STATISTICS, 8, "the statistics: schema_count"),
    (SUMMARY, Opcode.STATISTICS, 10, "the statistics: channel_count"),
    (SUMMARY, Opcode.STATISTICS, 14, "the statistics: attachment_count"),
    (SUMMARY, Opcode.STATISTICS, 18, "the statistics: metadata_count"),
    (SUMMARY, Opcode.STATISTICS, 22, "the statistics: chunk_count"),
    (SUMMARY, Opcode.STATISTICS, 26, "the statistics: message_start_time"),
    (SUMMARY, Opcode.STATISTICS, 34, "the statistics: message_end_time"),
    (SUMMARY, Opcode.STATISTICS, -8, "the statistics: channel_message_counts"),
    (SUMMARY, Opcode.CHUNK_INDEX, 0, "index of the chunk .* message_start_time"),
    (SUMMARY, Opcode.CHUNK_INDEX, 8, "index of the chunk .* message_end_time"),
    (SUMMARY, Opcode.CHUNK_INDEX, 16, "the chunk indexes do not point at the chunks"),
    (SUMMARY, Opcode.CHUNK_INDEX, 24, "index of the chunk .* chunk_length"),
    (SUMMARY, Opcode.CHUNK_INDEX, 38, "index of the chunk .* message_index_offsets"),
    (SUMMARY, Opcode.CHUNK_INDEX, -28, "index of the chunk .* message_index_length"),
    (SUMMARY, Opcode.CHUNK_INDEX, -17, "index of the chunk .* compression"),
    (SUMMARY, Opcode.CHUNK_INDEX, -16, "index of the chunk .* compressed_size"),
    (SUMMARY, Opcode.CHUNK_INDEX, -8, "index of the chunk .* uncompressed_size"),
    (SUMMARY, Opcode.ATTACHMENT_INDEX, 0, "no index points at the ATTACHMENT"),
    (SUMMARY, Opcode.ATTACHMENT_INDEX, 8, "index of the ATTACHMENT .* length"),
    (SUMMARY, Opcode.ATTACHMENT_INDEX, 16, "index of the ATTACHMENT .* log_time"),
    (SUMMARY, Opcode.ATTACHMENT_INDEX, 24, "index of the ATTACHMENT .* create_time"),
    (SUMMARY, Opcode.ATTACHMENT_INDEX, 32, "index of the ATTACHMENT .* data_size"),
    (SUMMARY, Opcode.ATTACHMENT_INDEX, 44, "index of the ATTACHMENT .* name"),
    (SUMMARY, Opcode.METADATA_INDEX, 0, "no index points at the METADATA"),
    (SUMMARY, Opcode.METADATA_INDEX, 8, "index of the METADATA .* length"),
    (SUMMARY, Opcode.METADATA_INDEX, 20, "index of the METADATA .* name"),
    (SUMMARY, Opcode.SUMMARY_OFFSET, 0, "the summary offsets are|two summary offsets"),
    (SUMMARY, Opcode.SUMMARY_OFFSET, 1, "the summary offsets are"),
    (SUMMARY, Opcode.SUMMARY_OFFSET, 9, "the summary offsets are"),
]


class Overlooked(Exception):
    """The check let something through, or refused it for another reason."""


def refused(data, sentence, what):
    try:
        check(bytes(data))
    except Broken as broken:
        if not re.search(sentence, str(broken)):
            raise Overlooked(f"{what}: refused with '{broken}', not with '{sentence}'") from broken
        return
    raise Overlooked(f"{what} is overlooked")


def resealed(data):
    """The same bytes with the check sums of the data section and the summary made right; the footer's length never changes."""
    footer = len(data) - len(MAGIC) - 20
    end = struct.unpack_from("<Q", data, footer)[0] - 4
    # a damaged footer does not say where the data end: they end where they did
    if data[end - PREFIX] == Opcode.DATA_END:
        struct.pack_into("<I", data, end, zlib.crc32(data[: end - PREFIX]))
        struct.pack_into("<I", data, footer + 16, zlib.crc32(data[end + 4 : footer + 16]))
    return data


def in_fields(data):
    file = File(data)
    for section, opcode, place, sentence in FIELDS:
        held = [file.header, file.footer] if section == ENDS else getattr(file, section)
        record = next((r for r in held if r.opcode == opcode), None)
        if record is None:
            raise Overlooked(f"the file has no {opcode.name} to damage")
        damaged = bytearray(data)
        damaged[record.start + PREFIX + place if place >= 0 else record.end + place] ^= 1
        refused(resealed(damaged), sentence, f"byte {place} of the {opcode.name} in the {section}")
    return len(FIELDS)


def in_bits(data, rng):
    """No bit of a file can flip unseen: every byte lies under a check sum or is one."""
    for _ in range(FLIPS):
        at, bit = rng.randrange(len(data)), rng.randrange(8)
        damaged = bytearray(data)
        damaged[at] ^= 1 << bit
        refused(damaged, "", f"bit {bit} of byte {at}")
    for length in (0, 7, 8, len(data) // 2, len(data) - 9, len(data) - 8, len(data) - 1):
        refused(data[:length], "", f"a file cut after {length} bytes")
    refused(data + b"\0", "", "a byte behind the end")


def by_hand(profile="surgescope", schema_data=None, schema_id=None, message=b"\x09" + bytes(8), stray_channel=0):
    """A file of Python's own writer."""
    out = io.BytesIO()
    writer = Writer(out, compression=CompressionType.ZSTD, index_types=IndexType.ALL, enable_data_crcs=True)
    writer.start(profile=profile, library="python")
    proto = descriptor_pb2.FileDescriptorProto()
    wrappers_pb2.DESCRIPTOR.CopyToProto(proto)
    whole = descriptor_pb2.FileDescriptorSet(file=[proto]).SerializeToString()
    schema = writer.register_schema("google.protobuf.DoubleValue", "protobuf", whole if schema_data is None else schema_data)
    channel = writer.register_channel("/a", "protobuf", schema if schema_id is None else schema_id)
    for time in (5, 3):
        writer.add_message(channel + stray_channel, log_time=time, publish_time=time, data=message)
    writer.add_attachment(create_time=1, log_time=2, name="a", media_type="text/plain", data=b"text")
    writer.add_metadata("m", {"key": "value"})
    writer.finish()
    return out.getvalue()


def in_meaning():
    """What another writer gets right or wrong."""
    check(by_hand())
    refused(by_hand(profile="other"), "the profile is 'other'", "another profile")
    refused(by_hand(schema_id=7), "refers to schema 7, which is not there", "a channel of no schema")
    refused(by_hand(stray_channel=1), "a message of the channel 2, not known yet", "a message of no channel")
    refused(by_hand(schema_data=b""), "no set of protobuf files with that message", "a schema without its message")
    refused(by_hand(schema_data=b"\xff\xff"), "no set of protobuf files", "a schema of noise")
    refused(by_hand(message=b"\x09\0"), "is not of its schema", "half a message")
    refused(by_hand(message=b"\x10\1"), "fields that its schema does not know", "a message of another schema")


def self_test(paths):
    """Exit code 0 where everything wrong is refused."""
    rng = random.Random(1)
    try:
        in_meaning()
        for path in paths:
            with open(path, "rb") as file:
                data = file.read()
            print(f"{path}: as the specification says: {check(data)}")
            fields = in_fields(data)
            in_bits(data, rng)
            print(f"{path}: all of {fields} wrong fields, {FLIPS} flipped bits and 8 wrong lengths are refused")
    except (Overlooked, Broken) as error:
        print(f"self-test: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(self_test(sys.argv[1:]) if sys.argv[1:] else __doc__)

"""The records of an MCAP file as bytes, as https://mcap.dev/spec lays them out; times are in nanoseconds."""

import struct
import zlib
from collections.abc import Mapping
from enum import IntEnum

import numpy as np

from anysim.conventions import Array


class Opcode(IntEnum):
    """The first byte of a record."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    ATTACHMENT = 0x09
    ATTACHMENT_INDEX = 0x0A
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


MAGIC = b"\x89MCAP0\r\n"
MESSAGE_HEAD = struct.Struct("<BQHIQQ")
"""What comes before a message's content: opcode, length of the rest, channel, sequence, log time, publish time."""
_PREFIX = struct.Struct("<BQ")


def record(opcode: Opcode, *content: bytes) -> bytes:
    """A record of any kind."""
    return b"".join((_PREFIX.pack(opcode, sum(map(len, content))), *content))


def header(library: str) -> bytes:
    """The first record of a file."""
    return record(Opcode.HEADER, _text(""), _text(library))


def schema(number: int, name: str, encoding: str, data: bytes) -> bytes:
    """A schema."""
    return record(Opcode.SCHEMA, struct.pack("<H", number), _text(name), _text(encoding), _sized(data))


def channel(number: int, schema_number: int, topic: str, encoding: str) -> bytes:
    """A channel without metadata."""
    return record(
        Opcode.CHANNEL, struct.pack("<HH", number, schema_number), _text(topic), _text(encoding), struct.pack("<I", 0)
    )


def message_head(number: int, length: int, sequence: int, time: int) -> bytes:
    """What comes before `length` bytes of a message's content."""
    rest = MESSAGE_HEAD.size - _PREFIX.size + length
    return MESSAGE_HEAD.pack(Opcode.MESSAGE, rest, number, sequence, time, time)


def metadata(name: str, values: Mapping[str, str]) -> bytes:
    """Facts by name."""
    pairs = b"".join(_text(key) + _text(value) for key, value in values.items())
    return record(Opcode.METADATA, _text(name), _sized(pairs))


def metadata_index(offset: int, length: int, name: str) -> bytes:
    """Where a metadata record is."""
    return record(Opcode.METADATA_INDEX, struct.pack("<QQ", offset, length), _text(name))


def attachment(name: str, media_type: str, content: bytes) -> bytes:
    """A file within the file, at time 0."""
    sized = struct.pack("<Q", len(content))
    data = b"".join((bytes(16), _text(name), _text(media_type), sized, content))
    return record(Opcode.ATTACHMENT, data, struct.pack("<I", zlib.crc32(data)))


def attachment_index(offset: int, length: int, size: int, name: str, media_type: str) -> bytes:
    """Where an attachment is; `size` is that of its content."""
    head = struct.pack("<QQQQQ", offset, length, 0, 0, size)
    return record(Opcode.ATTACHMENT_INDEX, head, _text(name), _text(media_type))


def chunk(first: int, last: int, data: bytes, packed: bytes, compression: str) -> bytes:
    """Messages between two times, `data`, which are `packed` in the file.

    What is compressed carries zstd's own checksum, which takes a tenth of the time; MCAP then allows none (0).
    """
    head = struct.pack("<QQQI", first, last, len(data), 0 if compression else zlib.crc32(data))
    return record(Opcode.CHUNK, head, _text(compression), struct.pack("<Q", len(packed)), packed)


def message_index(number: int, times: Array, begins: Array) -> bytes:
    """Where in a chunk the messages of a channel begin (n,), and their log times (n,)."""
    entries = np.empty((len(times), 2), "<u8")
    entries[:, 0], entries[:, 1] = times, begins
    return record(Opcode.MESSAGE_INDEX, struct.pack("<HI", number, entries.nbytes), entries.tobytes())


def chunk_index(
    times: tuple[int, int],
    at: int,
    length: int,
    offsets: Mapping[int, int],
    index_length: int,
    compression: str,
    sizes: tuple[int, int],
) -> bytes:
    """Where a chunk is, and where the message index of each of its channels; `sizes`: packed, and unpacked."""
    pairs = b"".join(struct.pack("<HQ", *pair) for pair in offsets.items())
    return record(
        Opcode.CHUNK_INDEX,
        struct.pack("<QQQQ", *times, at, length),
        _sized(pairs),
        struct.pack("<Q", index_length),
        _text(compression),
        struct.pack("<QQ", *sizes),
    )


def statistics(
    schemas: int,
    channels: int,
    attachments: int,
    metadatas: int,
    chunks: int,
    times: tuple[int, int],
    counts: Mapping[int, int],
) -> bytes:
    """How many there are of everything; `counts` are messages by channel."""
    head = struct.pack("<QHIIIIQQ", sum(counts.values()), schemas, channels, attachments, metadatas, chunks, *times)
    return record(Opcode.STATISTICS, head, _sized(b"".join(struct.pack("<HQ", *pair) for pair in counts.items())))


def data_end(crc: int) -> bytes:
    """The end of the data section; `crc` is of all before it."""
    return record(Opcode.DATA_END, struct.pack("<I", crc))


def summary_offset(opcode: Opcode, at: int, length: int) -> bytes:
    """Where the records of a kind are in the summary."""
    return record(Opcode.SUMMARY_OFFSET, struct.pack("<BQQ", opcode, at, length))


def footer(summary: bytes, at: int, offsets_at: int) -> bytes:
    """The last record: where the summary begins, and its offsets in it."""
    places = struct.pack("<QQ", at, offsets_at)
    crc = zlib.crc32(_PREFIX.pack(Opcode.FOOTER, 20) + places, zlib.crc32(summary))
    return record(Opcode.FOOTER, places, struct.pack("<I", crc))


def _text(value: str) -> bytes:
    return _sized(value.encode())


def _sized(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data

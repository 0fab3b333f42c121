"""An MCAP file whose messages are written in blocks: thousands of equal length in one piece, cut into chunks.

Byte for byte what `mcap.writer.Writer` writes of the same messages one by one, with its CRCs and all its indexes.
"""

import zlib
from collections.abc import Callable
from typing import IO, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim_mcap import records
from anysim_mcap.records import Opcode


class Messages(NamedTuple):
    """Complete message records, one after the other.

    Attributes:
        data: (L,) uint8.
        ends: (M,) where each message ends in it.
        channels: (M,) their channels.
        times: (M,) their log times [ns], never decreasing.
    """

    data: Array
    ends: Array
    channels: Array
    times: Array


def one_message(channel: int, sequence: int, time: int, content: bytes) -> Messages:
    """A single message at a log time [ns]."""
    data = records.message_head(channel, len(content), sequence, time) + content
    return Messages(
        np.frombuffer(data, np.uint8), np.array([len(data)]), np.array([channel]), np.array([time], np.uint64)
    )


class McapFile:
    """Writes one file: schemas, channels and what is said once, then messages, then `finish`."""

    def __init__(self, file: IO[bytes], library: str, chunk_size: int, zstd: Callable[[bytes], bytes] | None) -> None:
        """`chunk_size` [bytes]: a chunk ends with the message that exceeds it. `zstd` compresses chunks."""
        self._file, self._chunk_size, self._zstd = file, chunk_size, zstd
        self._crc = self._offset = 0
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._attachments: list[bytes] = []
        self._metadata: list[bytes] = []
        self._chunks: list[bytes] = []
        self._counts: dict[int, int] = {}
        self._times: tuple[int, int] = (0, 0)
        self._parts: list[bytes | memoryview] = []  # of the chunk in the making
        self._size = 0
        self._pieces: list[tuple[int, Messages]] = []  # where in it each begins
        self._write(records.MAGIC + records.header(library))

    # ------------------------------------------------------------------ what is said once

    def metadata(self, name: str, values: dict[str, str]) -> None:
        """Facts by name."""
        data = records.metadata(name, values)
        self._metadata.append(records.metadata_index(self._offset, len(data), name))
        self._write(data)

    def attachment(self, name: str, media_type: str, content: bytes) -> None:
        """A file within the file, without a time."""
        data = records.attachment(name, media_type, content)
        self._attachments.append(records.attachment_index(self._offset, len(data), len(content), name, media_type))
        self._write(data)

    def schema(self, name: str, encoding: str, data: bytes) -> int:
        """Returns its number."""
        number = len(self._schemas) + 1
        self._schemas.append(records.schema(number, name, encoding, data))
        self._hold(self._schemas[-1])
        return number

    def channel(self, topic: str, schema: int, encoding: str = "protobuf") -> int:
        """Returns its number."""
        number = len(self._channels) + 1
        self._channels.append(records.channel(number, schema, topic, encoding))
        self._hold(self._channels[-1])
        return number

    # ------------------------------------------------------------------ messages

    def messages(self, block: Messages) -> None:
        """Many messages, in order."""
        begin, start = 0, 0
        while begin < len(block.ends):
            # the first message with which the chunk is larger than it should be ends it
            room = self._chunk_size - self._size + start
            over = max(begin, int(np.searchsorted(block.ends, room, side="right")))
            end = min(over + 1, len(block.ends))
            stop = int(block.ends[end - 1])
            self._pieces.append(
                (self._size - start, Messages(block.data[start:stop], *(a[begin:end] for a in block[1:])))
            )
            self._parts.append(block.data[start:stop].data)
            self._size += stop - start
            if over < len(block.ends):
                self._end_chunk()
            begin, start = end, stop

    def finish(self) -> None:
        """End the last chunk and write the summary. Does not close the file."""
        self._end_chunk()
        self._write(records.data_end(self._crc))
        statistics = records.statistics(
            len(self._schemas),
            len(self._channels),
            len(self._attachments),
            len(self._metadata),
            len(self._chunks),
            self._times,
            self._counts,
        )
        groups = {
            Opcode.SCHEMA: self._schemas, Opcode.CHANNEL: self._channels, Opcode.STATISTICS: [statistics],
            Opcode.CHUNK_INDEX: self._chunks, Opcode.ATTACHMENT_INDEX: self._attachments,
            Opcode.METADATA_INDEX: self._metadata,
        }  # fmt: skip
        start = at = self._offset
        offsets: list[bytes] = []
        for opcode, members in groups.items():
            length = sum(map(len, members))
            offsets.append(records.summary_offset(opcode, at, length))
            at += length
        summary = b"".join(data for members in (*groups.values(), offsets) for data in members)
        self._file.write(summary + records.footer(summary, start, at) + records.MAGIC)

    # ------------------------------------------------------------------ inside

    def _hold(self, data: bytes) -> None:
        """Put a record other than a message into the chunk."""
        self._parts.append(data)
        self._size += len(data)
        if self._size > self._chunk_size:
            self._end_chunk()

    def _end_chunk(self) -> None:
        """Write the chunk in the making; without messages it goes on."""
        if not self._pieces:
            return
        data = b"".join(self._parts)
        channels = np.concatenate([piece.channels for _, piece in self._pieces])
        times = np.concatenate([piece.times for _, piece in self._pieces])
        ends = np.concatenate([piece.ends + base for base, piece in self._pieces])
        begins = np.empty_like(ends)
        begins[1:] = ends[:-1]
        place = 0
        for base, piece in self._pieces:  # other records may lie before a piece
            begins[place] = base + int(piece.ends[-1]) - len(piece.data)
            place += len(piece.ends)
        span = int(times[0]), int(times[-1])
        compression, packed = ("", data) if self._zstd is None else ("zstd", self._zstd(data))
        chunk = records.chunk(*span, data, packed, compression)
        chunk_at = index_at = self._offset
        index_at += len(chunk)
        offsets: dict[int, int] = {}
        indexes: list[bytes] = []
        for channel in dict.fromkeys(channels.tolist()):
            mine = channels == channel
            offsets[channel] = index_at
            indexes.append(records.message_index(channel, times[mine], begins[mine]))
            index_at += len(indexes[-1])
            self._counts[channel] = self._counts.get(channel, 0) + int(mine.sum())
        self._times = (self._times[0] if self._chunks else span[0], span[1])
        index = b"".join(indexes)
        self._chunks.append(
            records.chunk_index(span, chunk_at, len(chunk), offsets, len(index), compression, (len(packed), len(data)))
        )
        self._write(chunk)
        self._write(index)
        self._parts, self._size, self._pieces = [], 0, []

    def _write(self, data: bytes) -> None:
        self._crc = zlib.crc32(data, self._crc)
        self._offset += len(data)
        self._file.write(data)

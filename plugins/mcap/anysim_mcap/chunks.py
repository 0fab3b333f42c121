"""The records of an MCAP file that is not trusted: sizes are checked before memory is taken for them."""

import mmap
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from anysim.errors import RecordError

MAX_FILE = 8 << 30
MAX_RECORD = 64 << 20
MAX_CHUNK = 64 << 20
"""Bytes of a file, of one record, and of one decompressed chunk; a writer's chunks are at most 16 MiB and a frame."""


def records(path: Path) -> Iterator[Any]:
    """All records in the order of the file, those in chunks included; every checksum is checked.

    Raises:
        RecordError: the file ends too early, is damaged, or asks for more memory than a trajectory needs.
    """
    import zstandard
    from mcap.exceptions import EndOfFile, McapError
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, breakup_chunk

    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), _size(path), access=mmap.ACCESS_READ) as data:
            # reading from a map never takes more memory than there is file, whatever length a record claims
            reader = StreamReader(data, emit_chunks=True, validate_crcs=True, record_size_limit=MAX_RECORD)  # pyright: ignore[reportArgumentType]
            for record in reader.records:
                if isinstance(record, Chunk):
                    _check_chunk(path, record, zstandard)
                    yield from breakup_chunk(record, validate_crc=True)
                else:
                    yield record
    except OSError as error:
        raise RecordError(f"{path} cannot be read: {error.strerror or error}") from error
    except (EndOfFile, struct.error) as error:
        raise RecordError(f"{path} ends in the middle of a record; it was truncated, or never finished") from error
    except (McapError, ValueError, zstandard.ZstdError, MemoryError) as error:
        raise RecordError(f"{path} is damaged: {error}") from error


def _size(path: Path) -> int:
    size = path.stat().st_size
    if not 0 < size <= MAX_FILE:
        raise RecordError(f"{path} has {size} bytes; 1 to {MAX_FILE} are read")
    return size


def _check_chunk(path: Path, chunk: Any, zstandard: Any) -> None:
    if chunk.compression not in ("zstd", ""):
        raise RecordError(f"{path} is compressed by {chunk.compression!r}; a trajectory's writer uses zstd or nothing")
    real = zstandard.frame_content_size(chunk.data) if chunk.compression else len(chunk.data)
    if chunk.uncompressed_size > MAX_CHUNK or real != chunk.uncompressed_size:
        raise RecordError(
            f"{path} is damaged: a chunk of {real} bytes claims {chunk.uncompressed_size}, at most {MAX_CHUNK}"
        )

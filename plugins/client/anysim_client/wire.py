"""Frames of the data plane: a msgpack head and the bytes of arrays, in one binary message of bounded size.

A frame is `ASF1`, the length of the head as a little-endian uint32, the head, and then the arrays, each from the next
multiple of 64 bytes on. The head is `{"tree": …, "arrays": [[name, dtype, shape], …]}`; where an array stands in the
tree is `{"~array": name}`. The other marks are those of snapshots (`anysim.engine.snapshots.file`), and `~int` for a
number of more than 64 bits. Nothing in a frame is code: arrays are of truth values, numbers or text, never objects.

A service sends a frame of more than `PIECE` bytes in pieces: a message `ASP1` with the length of the frame as a
little-endian uint64, and then messages that hold it, one after the other.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import msgpack
import numpy as np

from anysim.conventions import Array
from anysim.engine.snapshots.file import decode, encode
from anysim.errors import SnapshotError
from anysim_client.errors import MalformedFrame

MAGIC, IN_PIECES = b"ASF1", b"ASP1"
PIECE = 1 << 19
"""Bytes that stay in a processor's cache while they are copied from layer to layer, and travel while the next are."""
Part = bytes | memoryview
ALIGNMENT = 64
HEAD_BYTES = 16 << 20
"""Of the head alone, at most."""
MOST_ARRAYS = 4096
_DTYPE = re.compile(r"[<>|=]?[biufSU]\d{1,5}")
_INT = "~int"


def pack(message: Mapping[str, Any]) -> bytes:
    """The frame of a tree of mappings, lists, tuples, arrays and plain values; equal messages give equal frames.

    Raises:
        MalformedFrame: something in it cannot travel.
    """
    return b"".join(parts(message))


def parts(message: Mapping[str, Any]) -> list[Part]:
    """The frame of `pack` as what it is made of: its arrays are not copied, and must stay as they are until it is sent.

    Raises:
        MalformedFrame: something in it cannot travel.
    """
    arrays: dict[str, Array] = {}
    try:
        tree = encode(message, arrays)
    except SnapshotError as error:
        raise MalformedFrame(str(error).replace("a snapshot's file", "a message")) from None
    rows = {name: array if array.flags.c_contiguous else array.copy() for name, array in arrays.items()}
    head = {"tree": tree, "arrays": [[name, array.dtype.str, array.shape] for name, array in rows.items()]}
    packer = msgpack.Packer()
    try:
        packed = packer.pack(head)
    except OverflowError:
        packed = msgpack.Packer().pack(_small(head))
    except (ValueError, RecursionError) as error:
        raise MalformedFrame(f"a message cannot be packed: {error}") from None
    made: list[Part] = [MAGIC + len(packed).to_bytes(4, "little") + packed]
    place = len(made[0])
    for array in rows.values():
        if gap := -place % ALIGNMENT:
            made.append(bytes(gap))
        if array.nbytes:
            made.append(array.reshape(-1).view(np.uint8).data)
        place += gap + array.nbytes
    return made


def messages(frame: Sequence[Part]) -> Iterator[Part]:
    """The messages that a frame travels in."""
    total = sum(len(part) for part in frame)
    if total <= PIECE:
        yield b"".join(frame)
        return
    yield IN_PIECES + total.to_bytes(8, "little")
    small: list[Part] = []
    for part in frame:
        if len(part) <= ALIGNMENT:  # what is between arrays travels with the next one
            small.append(part)
            continue
        for start in range(0, len(part), PIECE):
            piece = part[start : start + PIECE]
            yield b"".join([*small, piece]) if small else piece
            small = []
    if small:
        yield b"".join(small)


def announced(message: Array) -> int:
    """The length of the frame that follows in pieces; 0 if the message is the frame itself."""
    return int.from_bytes(message[4:].tobytes(), "little") if message[:4].tobytes() == IN_PIECES else 0


def unpack(frame: "bytes | Array") -> dict[str, Any]:
    """The message of a frame; its arrays are views of the frame, writable where that is.

    Raises:
        MalformedFrame: it is no frame, or says of itself what is not so.
    """
    try:
        return _unpacked(frame.data if isinstance(frame, np.ndarray) else memoryview(frame))
    except MalformedFrame:
        raise
    except (
        msgpack.UnpackException,
        ValueError,
        TypeError,
        KeyError,
        IndexError,
        OverflowError,
        RecursionError,
        AttributeError,
        MemoryError,
    ) as error:
        raise MalformedFrame(f"the frame is damaged: {type(error).__name__}: {str(error)[:120]}") from None


def _unpacked(view: memoryview) -> dict[str, Any]:
    if len(view) < 8 or view[:4] != MAGIC:
        raise MalformedFrame(f"a frame begins with {MAGIC.decode()} and the length of its head")
    length = int.from_bytes(view[4:8], "little")
    if length > min(HEAD_BYTES, len(view) - 8):
        raise MalformedFrame(f"the head of the frame should have {length} bytes, and {len(view) - 8} follow")
    head = msgpack.unpackb(view[8 : 8 + length], object_hook=_large, ext_hook=_refuse, timestamp=1)
    if not isinstance(head, dict) or head.keys() != {"tree", "arrays"} or not isinstance(head["arrays"], list):
        raise MalformedFrame("the head of a frame has the keys `tree` and `arrays`")
    if len(head["arrays"]) > MOST_ARRAYS:
        raise MalformedFrame(f"a frame has at most {MOST_ARRAYS} arrays, got {len(head['arrays'])}")
    arrays: dict[str, Array] = {}
    place = 8 + length
    for name, kind, shape in head["arrays"]:
        dtype, count = _form(kind, shape)
        place += -place % ALIGNMENT
        size = count * dtype.itemsize
        if size > len(view) - place:
            raise MalformedFrame(f"the array {str(name)[:60]!r} should have {size} bytes, and fewer follow")
        arrays[name] = np.frombuffer(view, dtype, count, place if size else 0).reshape(shape)
        place += size
    if place != len(view):
        raise MalformedFrame(f"{len(view) - place} bytes follow the last array")
    message = decode(head["tree"], arrays)
    if not isinstance(message, dict):
        raise MalformedFrame("a message is a mapping")
    return message


def _form(kind: object, shape: object) -> tuple[np.dtype[Any], int]:
    """The type of an array and its number of elements."""
    if not isinstance(kind, str) or not _DTYPE.fullmatch(kind):
        raise MalformedFrame(f"arrays hold truth values, numbers or text, not {str(kind)[:40]!r}")
    if not isinstance(shape, list) or not all(type(size) is int and size >= 0 for size in shape) or len(shape) > 16:
        raise MalformedFrame("the shape of an array is a list of whole numbers")
    count = 1
    for size in shape:
        count *= size
    dtype = np.dtype(kind)
    if not dtype.itemsize:
        raise MalformedFrame("text of no length has no place in a frame")
    return dtype, count


def _small(value: Any) -> Any:
    """The tree with numbers of more than 64 bits as text."""
    if isinstance(value, Mapping):
        return {key: _small(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return [_small(item) for item in value]
    if isinstance(value, int) and not -(1 << 63) <= value < 1 << 64:
        return {_INT: hex(value)}
    return value


def _refuse(code: int, _: bytes) -> Any:
    raise MalformedFrame(f"msgpack's extension {code} has no place in a frame")


def _large(found: dict[Any, Any]) -> Any:
    return int(found[_INT], 16) if found.keys() == {_INT} else found

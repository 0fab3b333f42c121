"""The protobuf wire format of arrays: a packed `repeated double` is a tag, a length, and the numbers' own bytes.

Written by hand because it is the recorder's inner loop: numpy's bytes go out as they are, exactly, without a Python
float in between. All platforms of anysim are little-endian, as the wire is.
"""

import struct

import numpy as np

from anysim.conventions import Array

VARINT, FIXED64, LENGTH = 0, 1, 2
"""Wire types."""

_DOUBLE = struct.Struct("<d")


def varint(value: int) -> bytes:
    """An unsigned integer, seven bits per byte."""
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def tag(number: int, wire_type: int) -> bytes:
    """The key of a field."""
    return varint(number << 3 | wire_type)


def block(number: int, data: bytes) -> bytes:
    """A length-delimited field: a string, a message, packed numbers."""
    return tag(number, LENGTH) + varint(len(data)) + data


def block_head(number: int, length: int) -> bytes:
    """What comes before `length` bytes of a length-delimited field."""
    return tag(number, LENGTH) + varint(length)


def double(value: float) -> bytes:
    """The bytes of a float64."""
    return _DOUBLE.pack(value)


def timestamp(log_time: int) -> bytes:
    """A google.protobuf.Timestamp of nanoseconds."""
    seconds, nanos = divmod(log_time, 1_000_000_000)
    return (tag(1, VARINT) + varint(seconds) if seconds else b"") + (tag(2, VARINT) + varint(nanos) if nanos else b"")


class TransformsEncoder:
    """foxglove.FrameTransforms of bodies in the world: everything but times and poses is a constant template."""

    def __init__(self, parent: str, children: tuple[str, ...]) -> None:
        self._tails = [block(2, parent.encode()) + block(3, child.encode()) for child in children]
        self._templates: dict[int, tuple[Array, Array, Array]] = {}

    def encode(self, log_time: int, poses: Array) -> bytes:
        """The message of poses (B, 7) float64 at a time [ns]."""
        stamp = timestamp(log_time)
        template = self._templates.get(len(stamp))
        if template is None:
            template = self._templates[len(stamp)] = self._template(len(stamp))
        data, stamps, numbers = template
        data[stamps] = np.frombuffer(stamp, np.uint8)
        data[numbers] = np.ascontiguousarray(poses).view(np.uint8).reshape(numbers.shape)
        return data.tobytes()

    def _template(self, stamp_length: int) -> tuple[Array, Array, Array]:
        """The message with holes, and where the holes are: (B, stamp_length) for stamps, (B, 56) for poses."""
        message = bytearray()
        stamps: list[list[int]] = []
        numbers: list[list[int]] = []
        for tail in self._tails:
            start = block_head(1, stamp_length) + bytes(stamp_length) + tail
            vector = b"".join(tag(i, FIXED64) + bytes(8) for i in (1, 2, 3))
            quaternion = b"".join(tag(i, FIXED64) + bytes(8) for i in (1, 2, 3, 4))
            body = start + block(4, vector) + block(5, quaternion)
            message += block_head(1, len(body))
            at = len(message)
            first = at + len(block_head(1, stamp_length))
            stamps.append(list(range(first, first + stamp_length)))
            translation = at + len(start) + len(block_head(4, len(vector)))
            rotation = translation + len(vector) + len(block_head(5, len(quaternion)))
            firsts = [translation + 9 * i + 1 for i in range(3)] + [rotation + 9 * i + 1 for i in range(4)]
            numbers.append([first + k for first in firsts for k in range(8)])
            message += body
        count = len(self._tails)
        return (
            np.frombuffer(message, np.uint8).copy(),
            np.array(stamps, dtype=np.intp).reshape(count, stamp_length),
            np.array(numbers, dtype=np.intp).reshape(count, 56),
        )

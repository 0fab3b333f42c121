"""The protobuf wire format of arrays: a packed `repeated double` is a tag, a length, and the numbers' own bytes.

Written by hand because it is the recorder's inner loop: numpy's bytes go out as they are, exactly, without a Python
float in between. All platforms of anysim are little-endian, as the wire is.
"""

import numpy as np

from anysim.conventions import Array

VARINT, FIXED64, LENGTH = 0, 1, 2
"""Wire types."""


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


def varints(values: Array, optional: bool = False) -> tuple[Array, Array]:
    """Unsigned integers (F,) as varints: bytes (F, 10), of which the first `lengths` (F,) count.

    `optional`: a zero has no bytes, as a field that is left out.
    """
    values = values.astype(np.uint64)
    shifted = values[:, None] >> (7 * np.arange(10, dtype=np.uint64))
    lengths = np.maximum((shifted > 0).sum(axis=1), 0 if optional else 1)
    more = np.arange(9) < lengths[:, None] - 1
    data = (shifted & np.uint64(0x7F)).astype(np.uint8)
    data[:, :9] |= more.astype(np.uint8) << 7
    return data, lengths

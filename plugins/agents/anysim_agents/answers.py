"""Answers of tools: short plain data, and images as PNG."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from math import isfinite
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.record.json import plain

DIGITS = 4
"""Decimals of numbers: a tenth of a millimetre, which a reader of text can use."""


@dataclass(frozen=True)
class Answer:
    """What a tool gives.

    Attributes:
        data: plain data.
        images: PNG files, in the order in which `data` speaks of them.
    """

    data: Mapping[str, Any]
    images: Sequence[bytes] = field(default=())


def shortened(value: Any) -> Any:
    """The data with numbers of DIGITS decimals, as JSON can hold it."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float) and isfinite(value):
        return round(value, DIGITS) + 0.0  # no negative zero
    if isinstance(value, Mapping):
        return {str(key): shortened(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [shortened(item) for item in value]
    return plain(value, "the answer")


def png(image: Array) -> bytes:
    """An image (H, W, 3) uint8 as a PNG file."""
    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(image).save(buffer, "png")
    return buffer.getvalue()

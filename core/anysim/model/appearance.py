"""Colours by name, textures and materials: engine-neutral looks. Nothing here changes how anything moves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import Issues, listing, suggest
from anysim.model.shapes import Vec3
from anysim.randomization.distributions import nominal, written

NONE = -1
"""Stands for no texture, or no material, where an index into the World's lists is expected."""


@dataclass(frozen=True, slots=True)
class Texture:
    """An image that is painted on each face of a thing's bounding box: pixels (S, S, 3) uint8, the top row first.

    `repeat` is how many times it stands side by side along an edge; `hash` is that of the pixels.
    """

    name: str
    pixels: Array = field(repr=False, compare=False)
    repeat: int = 1
    hash: str = ""

    def tiled(self, largest: int = 1024) -> Array:
        """The pixels of a whole face, `repeat` times side by side, no larger than `largest` along an edge."""
        size = len(self.pixels)
        side = min(size * self.repeat, largest)
        at = (((np.arange(side) + 0.5) * (size * self.repeat / side)).astype(int)) % size
        return self.pixels[np.ix_(at, at)]


@dataclass(frozen=True, slots=True)
class Material:
    """How a surface answers light; all but `color` in [0, 1].

    `color` is that of a thing of which nothing else says it, `roughness` 0 a mirror and 1 chalk; `metallic` gives
    highlights the colour of the surface, `specular` is the strength of those of what is no metal; `emission` is the
    share of its colour that shines by itself, `opacity` 1 hides what is behind it.
    """

    name: str
    color: Vec3 = (0.7, 0.7, 0.7)
    roughness: float = 0.9
    metallic: float = 0.0
    specular: float = 0.2
    emission: float = 0.0
    opacity: float = 1.0


def wrapped(corners: Array) -> Array:
    """Places (T, 3, 2) of triangles' corners (T, 3, 3) in a texture that is painted on each face of their bounding box.

    u to the right and v upwards in [0, 1], as seen from outside with z up; a triangle lies on the face that it looks
    towards most.
    """
    low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
    place = (corners - low) / np.where(high > low, high - low, 1.0)
    x, y, z = place[..., 0], place[..., 1], place[..., 2]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    axis = np.abs(normal).argmax(axis=1)
    ahead = np.take_along_axis(normal, axis[:, None], axis=1) > 0
    u = np.select([axis[:, None] == 0, axis[:, None] == 1], [np.where(ahead, y, 1 - y), np.where(ahead, 1 - x, x)], x)
    v = np.where(axis[:, None] == 2, np.where(ahead, y, 1 - y), z)
    return np.stack([u, v], axis=-1)


def lying(corners: Array) -> Array:
    """Places (T, 3, 2) in a texture that lies on the ground, once a metre; u along x and v along y, above 0."""
    flat = corners[..., :2]
    return flat - np.floor(flat.reshape(-1, 2).min(axis=0))


Rgb = tuple[float, float, float]

_HEX = {
    "black": 0x000000, "white": 0xFFFFFF, "gray": 0x808080, "grey": 0x808080, "silver": 0xC0C0C0, "red": 0xFF0000,
    "maroon": 0x800000, "brown": 0xA52A2A, "orange": 0xFFA500, "gold": 0xFFD700, "yellow": 0xFFFF00, "olive": 0x808000,
    "lime": 0x00FF00, "green": 0x008000, "teal": 0x008080, "cyan": 0x00FFFF, "blue": 0x0000FF, "navy": 0x000080,
    "purple": 0x800080, "magenta": 0xFF00FF, "pink": 0xFFC0CB, "beige": 0xF5F5DC,
}  # fmt: skip

COLORS: Mapping[str, Rgb] = {
    name: ((value >> 16) / 255, (value >> 8 & 255) / 255, (value & 255) / 255) for name, value in _HEX.items()
}
WHITE: Rgb = (1.0, 1.0, 1.0)


def rgb(color: str | Sequence[float]) -> Rgb:
    """Red, green, blue in [0, 1] of a colour name or a triple.

    Raises:
        ValueError: an unknown name; lists the known ones.
    """
    if isinstance(color, str):
        if color not in COLORS:
            raise ValueError(
                f"there is no colour '{color}'{suggest(color, list(COLORS))} (colours: {listing(COLORS, 30)})"
            )
        return COLORS[color]
    red, green, blue = color
    return (float(red), float(green), float(blue))


def nominal_rgb(color: Any, otherwise: Rgb, issues: Issues, path: str = "color") -> Rgb:
    """The nominal colour of a value, `otherwise` where it is None or at fault; all that may be drawn are checked."""
    if color is None:
        return otherwise
    try:
        for one in written(color):
            rgb(one)
        return rgb(nominal(color))
    except ValueError as error:
        issues.add(path, str(error))
        return otherwise

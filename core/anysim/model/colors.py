"""Colour names, with the values of CSS."""

from collections.abc import Mapping, Sequence
from typing import Any

from anysim.errors import listing, suggest
from anysim.issues import Issues
from anysim.randomization.distributions import nominal, written

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

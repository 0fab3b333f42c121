"""Names of colours, by whole-number arithmetic on 8-bit values: the same name on every machine."""

from collections.abc import Sequence

from anysim.model.appearance import COLORS

MARGIN = 10
"""By how much [of 255] each channel may be off without another name, where a colour is asked for."""

_SYNONYMS = {
    "grey": "gray",
    "silver": "light gray",
    "navy": "dark blue",
    "maroon": "dark red",
    "lime": "green",
    "gold": "yellow",
    "magenta": "pink",
    "cyan": "light blue",
}
_EXACT = {tuple(round(255 * x) for x in value): _SYNONYMS.get(name, name) for name, value in COLORS.items()}
_HUES = (
    (15, "red"),
    (46, "orange"),
    (68, "yellow"),
    (160, "green"),
    (200, "teal"),
    (255, "blue"),
    (312, "purple"),
    (340, "pink"),
    (361, "red"),
)
"""Upper ends of hues [degrees]."""


def bytes_of(color: Sequence[float]) -> tuple[int, int, int]:
    """Red, green and blue in 0 to 255 of values in [0, 1]."""
    red, green, blue = (min(max(int(float(x) * 255.0 + 0.5), 0), 255) for x in color[:3])
    return red, green, blue


def colour_name(color: tuple[int, int, int]) -> str:
    """The name of a colour of 8-bit values: that of the palette where it is exactly one of them, else by its hue."""
    exact = _EXACT.get(color)
    return exact if exact is not None else _by_hue(*color)


def is_clear(color: tuple[int, int, int]) -> bool:
    """Whether every colour within MARGIN has the same name, so that it may be asked for."""
    name = colour_name(color)
    return all(
        _by_hue(*(min(max(value + step, 0), 255) for value, step in zip(color, steps, strict=True))) == name
        for steps in _STEPS
    )


_STEPS = [(MARGIN * r, MARGIN * g, MARGIN * b) for r in (-1, 0, 1) for g in (-1, 0, 1) for b in (-1, 0, 1)]


def _by_hue(red: int, green: int, blue: int) -> str:
    high, low = max(red, green, blue), min(red, green, blue)
    chroma = high - low
    if high <= 40:
        return "black"
    if chroma * 4 <= high:  # less than a quarter saturated
        return "dark gray" if high < 96 else "gray" if high < 176 else "light gray" if high < 232 else "white"
    if high == red:
        turn = 60 * (green - blue)
    elif high == green:
        turn = 120 * chroma + 60 * (blue - red)
    else:
        turn = 240 * chroma + 60 * (red - green)
    turn %= 360 * chroma
    hue = next(name for end, name in _HUES if turn < end * chroma)
    if hue in ("red", "orange", "yellow") and chroma * 2 <= high and high >= 150:
        return "beige"
    if hue == "orange" and high < 200:
        return "brown"
    if hue == "yellow" and high < 160:
        return "olive"
    if hue in ("red", "blue") and high < 112:
        return f"dark {hue}"
    return hue

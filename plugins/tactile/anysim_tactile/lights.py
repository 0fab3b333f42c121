"""Lights of visuotactile sensors: how the colours of a gel follow from its slope, fitted to photographs or guessed."""

from math import cos, pi, radians, sin
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError, listing, suggest


class Light(NamedTuple):
    """The levels of red, green and blue (columns) in an image, 0 to 255.

    Attributes:
        background: (6, 3) where nothing touches: factors of 1, x, y, x^2, xy, y^2, where x and y go from -1 to 1 across
            the image, to the right and down.
        matrix: (3, 3) what a unit of the gel's normal adds: to the right, down, and away from the camera less 1.
        calibrated: whether it was fitted to photographs of a device.
        source: where the numbers are from, and how good they are.
    """

    background: tuple[tuple[float, float, float], ...]
    matrix: tuple[tuple[float, float, float], ...]
    calibrated: bool
    source: str

    def undisturbed(self, shape: tuple[int, int]) -> Array:
        """(H, W, 3) levels where nothing touches."""
        rows, columns = shape
        x, y = np.meshgrid((np.arange(columns) + 0.5) / columns * 2 - 1, (np.arange(rows) + 0.5) / rows * 2 - 1)
        terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
        return np.add.reduce(terms[..., None] * np.array(self.background), axis=-2)


def _three_leds(level: float, brightness: float, elevation: float) -> Light:
    """Red, green and blue lamps 120 degrees apart, at an elevation [degrees], on a gel of one colour (Lambert)."""
    flat, up = cos(radians(elevation)), sin(radians(elevation))
    turns = [2 * pi * k / 3 for k in range(3)]
    rows = tuple(tuple(brightness * f(turn) * flat for turn in turns) for f in (cos, sin))
    matrix = (*rows, (brightness * up,) * 3)
    background = ((level,) * 3, *((0.0,) * 3,) * 5)
    return Light(background, matrix, False, "a textbook guess: three lamps 120 degrees apart; no device looks like it")  # pyright: ignore[reportArgumentType]


LIGHTS = {
    "gelsight": Light(
        (
            (154.2, 143.8, 147.6),
            (6.1, -6.7, -15.8),
            (-8.3, -13.0, 5.3),
            (-41.0, -21.5, -16.8),
            (9.6, 11.0, -25.8),
            (-32.5, -9.3, -5.4),
        ),
        ((83.79, -27.89, -35.01), (-2.03, -53.88, 47.74), (42.42, 28.48, 12.43)),
        True,
        "least squares over 36 of the 48 photographs of ball presses on a GelSight in dataPack.npz of taxim 1.4.1 "
        "(MIT, CMURoboTouch), the background over its first frame; a ball of 2.38 mm radius and 0.0295 mm a pixel "
        "assumed. On the other 12, in the contact: 30.3 dB, and 19.2 dB with no light; cosine of the change 0.963",
    ),
    "uncalibrated_three_leds": _three_leds(120.0, 90.0, 20.0),
}
"""By name; those that are guesses begin with `uncalibrated`, so that a recording's header says it."""


def light(name: str) -> Light:
    """One of the lights.

    Raises:
        AnysimError: there is none of that name; lists them.
    """
    if name not in LIGHTS:
        raise AnysimError(f"there is no light '{name}'{suggest(name, list(LIGHTS))} (lights: {listing(LIGHTS)})")
    return LIGHTS[name]


def fitted(photographs: Array, background: Array, centres: Array, radii: Array, ball: float, source: str) -> Light:
    """The light of a device, from photographs of presses with one ball.

    Args:
        photographs: (P, H, W, 3) levels of red, green and blue.
        background: (H, W, 3) one where nothing touches.
        centres: (P, 2) columns and rows of the presses.
        radii: (P,) of the contacts [pixels].
        ball: its radius [pixels].
        source: of the photographs; kept with the numbers.

    Raises:
        AnysimError: a contact is wider than the ball.
    """
    if not np.max(radii) < ball:
        raise AnysimError(
            f"a contact has a radius of {np.max(radii):g} pixels, and the ball of {ball:g}; check the scale"
        )
    rows, columns = background.shape[:2]
    v, u = np.mgrid[:rows, :columns].astype(float)
    x, y = ((u + 0.5) / columns * 2 - 1).ravel(), ((v + 0.5) / rows * 2 - 1).ravel()
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    still = np.asarray(background, dtype=float)
    normals: list[Array] = []
    changes: list[Array] = []
    for photograph, centre, radius in zip(photographs, centres, radii, strict=True):
        a, b = (u - centre[0]) / ball, (v - centre[1]) / ball
        inside = a * a + b * b < (radius / ball) ** 2
        a, b = a[inside], b[inside]
        normals.append(np.stack([a, b, np.sqrt(1.0 - a * a - b * b) - 1.0], axis=-1))
        changes.append(photograph[inside].astype(float) - still[inside])
    levels = np.linalg.lstsq(terms, still.reshape(-1, 3), rcond=None)[0]
    matrix = np.linalg.lstsq(np.concatenate(normals), np.concatenate(changes), rcond=None)[0]
    return Light(_rows(levels), _rows(matrix), True, source)


def _rows(array: Array) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(r), float(g), float(b)) for r, g, b in array)

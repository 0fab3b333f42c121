"""Patterns of LiDARs, as data: which way each ray of a scan goes, and when.

A sensor's frame has x ahead, y left and z up; azimuth turns about z from x to y, elevation is up. Angles in radians.
"""

from collections.abc import Sequence
from math import pi
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array

GOLDEN = (5**0.5 - 1) / 2
"""The ratio that is farthest from all fractions: what turns by it between two turns of something else never repeats."""


class Pattern(NamedTuple):
    """The rays of one scan.

    Attributes:
        directions: (R, 3) unit, in the sensor's frame.
        times: (R,) [s] from the beginning of the scan.
    """

    directions: Array
    times: Array


def directions_of(azimuth: Array, elevation: Array) -> Array:
    """Unit directions (..., 3) of azimuths and elevations (...)."""
    flat = np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=-1)


def spinning(elevations: Sequence[float], columns: int, rate: float, field: float = 2 * pi) -> Pattern:
    """Beams one above the other that turn together: column after column, `rate` turns [1/s].

    A `field` of less than a turn is centred ahead, and its last column is at its end.
    """
    full = field >= 2 * pi
    azimuth = np.linspace(-field / 2, field / 2, columns, endpoint=not full)
    turn, up = np.meshgrid(azimuth, np.asarray(elevations, dtype=float), indexing="ij")
    times = np.repeat((azimuth - azimuth[0]) / (2 * pi * rate), len(elevations))
    return Pattern(directions_of(turn, up).reshape(-1, 3), times)


def planar(columns: int, rate: float, field: float = 2 * pi) -> Pattern:
    """One beam that turns in the sensor's xy plane."""
    return spinning((0.0,), columns, rate, field)


def rosette(count: int, rate: float, half_angle: float, petals: float = 7.3, scan: int = 0) -> Pattern:
    """Two prisms that turn one way and the other, as in a solid-state LiDAR that looks ahead: a rosette about x.

    The scans after each other, `rate` of them a second of `count` points each, fill the cone of `half_angle` more and
    more: `petals` a scan, and a number that is no fraction of the turns.
    """
    moment = (np.arange(count) + scan * count) / count
    one, two = 2 * pi * petals * moment, -2 * pi * petals * (1 + GOLDEN) * moment
    y, z = (half_angle / 2 * (part(one) + part(two)) for part in (np.cos, np.sin))
    return Pattern(directions_of(y, z), np.arange(count) / (count * rate))


def wound(count: int, rate: float, low: float, high: float, turns: float = 20.3, scan: int = 0) -> Pattern:
    """A beam that turns about z while it goes up and down between two elevations, never the same way again."""
    moment = (np.arange(count) + scan * count) / count
    phase = (turns * (4 + GOLDEN) * moment) % 1.0
    elevation = low + (high - low) * (1 - np.abs(2 * phase - 1))
    return Pattern(directions_of(2 * pi * turns * moment, elevation), np.arange(count) / (count * rate))


def grid(size: tuple[float, float], spacing: float) -> Array:
    """Points (R, 2) [m] of a height scan: a grid about the sensor, row by row from lowest x and y."""
    counts = [max(1, round(length / spacing) + 1) for length in size]
    x, y = ((np.arange(n) - (n - 1) / 2) * spacing for n in counts)
    return np.stack(np.meshgrid(x, y, indexing="xy"), axis=-1).reshape(-1, 2)

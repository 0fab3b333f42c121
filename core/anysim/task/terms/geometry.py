"""Axes of frames and angles between them, as terms measure them."""

from typing import Literal

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P

Axes = Literal["xyz", "xy", "xz", "yz", "x", "y", "z"]
AXES = {name: ["xyz".index(letter) for letter in name] for name in ("xy", "xz", "yz", "x", "y", "z")}
"""Columns of a position."""

Axis = Literal["x", "y", "z", "-x", "-y", "-z"]


def axis_of(quaternion: Array, axis: Axis) -> Array:
    """An axis (n, 3) of frames with these orientations (n, 4), in the world."""
    unit = np.zeros(3)
    unit["xyz".index(axis[-1])] = -1.0 if axis[0] == "-" else 1.0
    return P.rotate(quaternion, np.broadcast_to(unit, (len(quaternion), 3)))


def turned_by(a: Array, b: Array, symmetry: int = 1) -> Array:
    """The angle [rad] (n,) from a to b (n, 4), where b is the same after each 1/symmetry of a turn about its z axis."""
    turns = 2.0 * np.pi * np.arange(symmetry) / symmetry
    spun = [P.multiply(b, P.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(turn))) for turn in turns.tolist()]
    return np.min([P.angle_between(a, one) for one in spun], axis=0)

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


def along(vectors: Array, axes: Axes) -> Array:
    """The lengths (n,) of vectors (n, 3) along some of their axes."""
    return P.norm(vectors if axes == "xyz" else vectors[:, AXES[axes]])


def turned_by(a: Array, b: Array, symmetry: int = 1) -> Array:
    """The angle [rad] (n,) from a to b (n, 4), where b is the same after each 1/symmetry of a turn about its z axis."""
    return np.min([P.angle_between(a, one) for one in _alike(b, symmetry)], axis=0)


def least_turn(a: Array, b: Array, symmetry: int = 1) -> Array:
    """The rotation vector (n, 3) [rad] from a to b (n, 4), in the axes of a: the shortest of those to what b may be."""
    ways = np.stack([P.rotation_vector(P.multiply(P.conjugate(a), one)) for one in _alike(b, symmetry)])
    return np.take_along_axis(ways, np.argmin(P.norm(ways), axis=0)[None, :, None], axis=0)[0]


def _alike(b: Array, symmetry: int) -> list[Array]:
    """Orientations (n, 4) that are the same after each 1/symmetry of a turn about z."""
    turns = 2.0 * np.pi * np.arange(symmetry) / symmetry
    return [P.multiply(b, P.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(turn))) for turn in turns.tolist()]

"""Rasters: paths that cover a rectangle in rows, to and fro, and what of it has been covered."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P

OVERLAP = 0.8
"""Rows are at most this share of the tool's width apart."""


class Raster:
    """Rows along x that cover a rectangle about the origin with a tool of a certain width, the same in each env.

    Attributes:
        length: [m] of the path.
    """

    def __init__(self, size: tuple[float, float], width: float) -> None:
        """`size` [m] along x and y; `width` [m] of the tool."""
        half = [max(0.5 * (side - width), 0.0) for side in size]
        rows = int(np.ceil(2 * half[1] / (OVERLAP * width))) + 1
        y = np.linspace(-half[1], half[1], rows).repeat(2)
        x = np.resize([-half[0], half[0], half[0], -half[0]], 2 * rows)
        self._corners = np.stack([x, y], axis=1)
        self._at = np.concatenate([[0.0], np.cumsum(P.norm(np.diff(self._corners, axis=0)))])
        self.length = float(self._at[-1])

    def point(self, along: Array) -> Array:
        """(n, 2) [m] where the path is after lengths (n,) [m]."""
        return np.stack([np.interp(along, self._at, self._corners[:, axis]) for axis in range(2)], axis=1)


class Coverage:
    """Cells of a rectangle about the origin, and in which envs a tool has been over them."""

    def __init__(self, num_envs: int, size: tuple[float, float], width: float) -> None:
        self._reach = 0.5 * width
        sides = [(np.arange(count) + 0.5) / count - 0.5 for count in (int(np.ceil(2 * side / width)) for side in size)]
        self._cells = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2) * np.array(size)
        self._covered = np.zeros((num_envs, len(self._cells)), dtype=bool)

    def clear(self, ids: Array) -> None:
        """Nothing has been covered in these envs."""
        self._covered[ids] = False

    def add(self, ids: Array, points: Array) -> None:
        """The tool's middle is at points (n, 2) [m]."""
        self._covered[ids] |= self._distance(points) <= self._reach

    def share(self, ids: Array) -> Array:
        """(n,) of the cells."""
        return self._covered[ids].mean(axis=1)

    def nearest_left(self, ids: Array, points: Array) -> Array:
        """(n, 2) [m] the nearest cell to points (n, 2) that is not covered; the first one where all are."""
        distance = np.where(self._covered[ids], np.inf, self._distance(points))
        return self._cells[np.argmin(distance, axis=1)]

    def _distance(self, points: Array) -> Array:
        return P.norm(self._cells[None] - points[:, None])

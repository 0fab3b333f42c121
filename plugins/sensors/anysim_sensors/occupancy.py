"""Occupancy grids of three values around a sensor: free, occupied, unknown."""

from math import ceil, inf, pi
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim_sensors.heights import upright
from anysim_sensors.scene import SceneGeometry
from anysim_sensors.states import UNKNOWN
from anysim_sensors.tables import GeomPoses


class Grid(NamedTuple):
    """An upright grid around a sensor: `size` along its heading and to its left, in square cells [m].

    `low` and `high` [m] over the sensor's origin bound what stands in the way.
    """

    size: tuple[float, float] = (6.0, 6.0)
    cell: float = 0.05
    low: float = 0.1
    high: float = 1.2

    @property
    def shape(self) -> tuple[int, int]:
        """Rows (along y) and columns (along x)."""
        return ceil(self.size[1] / self.cell - 1e-9), ceil(self.size[0] / self.cell - 1e-9)


def occupancy(
    scene: SceneGeometry, posed: GeomPoses, frames: Array, grid: Grid, *, reach: float = inf, seen: Array | None = None
) -> Array:
    """(N, rows, columns) int8: what stands between the grid's heights, as far as it is in sight of the sensor.

    A cell is occupied where something is within half a cell of the line up through its middle, and free where a line of
    sight over the grid crosses it. It is what is there, whatever its height; a LiDAR of one height misses what is
    taller or lower than its plane, see `occupancy_of_scan`.

    Args:
        scene: the shapes.
        posed: where they are.
        frames: (N, 7) poses of the sensor, of which position and heading count.
        grid: the grid, the sensor at its middle.
        reach: [m] how far it sees.
        seen: geoms that count; leave the robot's own bodies out.
    """
    from anysim_sensors.kernels import distances, visibility

    solid, states = _made(len(frames), grid)
    mask = scene.all if seen is None else seen
    level = upright(frames)
    distances.fill(scene.geoms, scene.triangles, posed, mask, level, grid.cell, grid.low, grid.high, solid)
    visibility.look(solid, _middle(len(frames), grid), reach / grid.cell, _beams(grid), states)
    return states


def occupancy_of_scan(distance: Array, azimuth: Array, grid: Grid, far: float) -> Array:
    """(N, rows, columns) int8 of the ranges (N, R) [m] of a LiDAR in a plane, along azimuths (R,) [rad].

    A range of inf is free up to `far`. It knows what one height knows; `low` and `high` of the grid do not count.
    """
    from anysim_sensors.kernels import visibility

    _, states = _made(len(distance), grid)
    ranges, turns = np.ascontiguousarray(distance, dtype=float), np.ascontiguousarray(azimuth, dtype=float)
    visibility.mark(ranges, turns, float(far), grid.cell, _middle(len(distance), grid), states)
    return states


def _made(envs: int, grid: Grid) -> tuple[Array, Array]:
    shape = (envs, *grid.shape)
    return np.zeros(shape, dtype=bool), np.full(shape, UNKNOWN, dtype=np.int8)


def _middle(envs: int, grid: Grid) -> Array:
    rows, columns = grid.shape
    return np.tile([columns / 2, rows / 2], (envs, 1))


def _beams(grid: Grid) -> int:
    """So many that no two are further apart than a cell where they leave the grid, and the same to all four sides."""
    return 4 * ceil(pi * np.hypot(*grid.shape) / 4)

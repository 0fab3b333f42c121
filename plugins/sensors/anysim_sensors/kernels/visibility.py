"""Compiled lines of sight over a grid: which cells a sensor at a point sees to be free."""

import math

import numpy as np

from anysim.conventions import Array
from anysim_sensors.kernels.bounds import compiled
from anysim_sensors.states import FREE, OCCUPIED, UNKNOWN


@compiled
def _lines(place: float, cell: int, along: float) -> tuple[float, float]:
    """How far it is along a beam from one line of the grid to the next, and to the first, from a place in a cell."""
    if along == 0.0:
        return np.inf, np.inf
    apart = 1 / abs(along)
    return apart, ((cell + 1 - place) if along > 0 else (place - cell)) * apart


@compiled
def look(solid: Array, start: Array, reach: float, beams: int, grid: Array) -> None:
    """Follow lines from a point until something solid; what they cross is free, and where they end is occupied.

    Args:
        solid: (N, rows, columns) bool.
        start: (N, 2) [cells] where the sensor is, column and row, from the grid's corner.
        reach: [cells] how far it sees.
        beams: lines to all sides.
        grid: (N, rows, columns) int8 written.
    """
    rows, columns = solid.shape[1], solid.shape[2]
    for e in range(solid.shape[0]):
        grid[e] = UNKNOWN
        for k in range(beams):
            angle = 2 * math.pi * (k + 0.5) / beams
            dx, dy = math.cos(angle), math.sin(angle)
            x, y = start[e, 0], start[e, 1]
            j, i = math.floor(x), math.floor(y)
            across, next_x = _lines(x, j, dx)
            down, next_y = _lines(y, i, dy)
            gone = 0.0
            while gone <= reach and 0 <= i < rows and 0 <= j < columns:
                if solid[e, i, j]:
                    grid[e, i, j] = OCCUPIED
                    break
                grid[e, i, j] = FREE
                if next_x < next_y:
                    gone, j, next_x = next_x, j + (1 if dx > 0 else -1), next_x + across
                else:
                    gone, i, next_y = next_y, i + (1 if dy > 0 else -1), next_y + down


@compiled
def mark(distance: Array, azimuth: Array, reach: float, cell: float, start: Array, grid: Array) -> None:
    """The same from the ranges (N, R) [m] that a LiDAR measured along azimuths (R,): inf is nothing up to `reach` [m].

    It is as if all that it met were in its plane. A cell in which any ray ends is occupied.
    """
    rows, columns = grid.shape[1], grid.shape[2]
    for e in range(grid.shape[0]):
        grid[e] = UNKNOWN
        for r in range(distance.shape[1]):
            dx, dy = math.cos(azimuth[r]), math.sin(azimuth[r])
            x, y = start[e, 0], start[e, 1]
            length = min(distance[e, r], reach) / cell
            j, i = math.floor(x), math.floor(y)
            across, next_x = _lines(x, j, dx)
            down, next_y = _lines(y, i, dy)
            while 0 <= i < rows and 0 <= j < columns:
                if min(next_x, next_y) > length:  # it ends here
                    if distance[e, r] <= reach:
                        grid[e, i, j] = OCCUPIED
                    break
                if grid[e, i, j] != OCCUPIED:
                    grid[e, i, j] = FREE
                if next_x < next_y:
                    j, next_x = j + (1 if dx > 0 else -1), next_x + across
                else:
                    i, next_y = i + (1 if dy > 0 else -1), next_y + down

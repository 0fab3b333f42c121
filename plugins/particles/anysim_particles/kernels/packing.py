"""Random packings: balls that come one after the other, each to a place where there is room for it."""

import math

import numpy as np

from anysim.conventions import Array
from anysim_particles.kernels.compiling import compiled


@compiled
def pack(tried: Array, low: Array, high: Array, diameter: float, packed: Array, done: int) -> int:
    """Take those of the places that are tried, in order, that are a diameter from all that were taken.

    Args:
        tried: (T, 3) [m] places.
        low, high: (3,) corners of what they are in.
        diameter: [m].
        packed: (P, 3) written from row `done` on; the rows before it are taken.
        done: how many were taken before.

    Returns:
        How many are taken now.
    """
    cell = diameter / math.sqrt(3.0)  # at most one in a cell
    sides = np.empty(3, dtype=np.int64)
    for k in range(3):
        sides[k] = int((high[k] - low[k]) / cell) + 1
    home = np.full(sides[0] * sides[1] * sides[2], -1, dtype=np.int64)
    at = np.empty(3, dtype=np.int64)
    for which in range(done):
        _cell(packed[which], low, cell, sides, at)
        home[at[0] + sides[0] * (at[1] + sides[1] * at[2])] = which
    for t in range(tried.shape[0]):
        if done == packed.shape[0]:
            break
        _cell(tried[t], low, cell, sides, at)
        free = True
        for i in range(max(0, at[0] - 2), min(sides[0], at[0] + 3)):
            for j in range(max(0, at[1] - 2), min(sides[1], at[1] + 3)):
                for k in range(max(0, at[2] - 2), min(sides[2], at[2] + 3)):
                    other = home[i + sides[0] * (j + sides[1] * k)]
                    if other >= 0:
                        away = 0.0
                        for c in range(3):
                            away += (packed[other, c] - tried[t, c]) ** 2
                        free = free and away >= diameter * diameter
        if free:
            home[at[0] + sides[0] * (at[1] + sides[1] * at[2])] = done
            for c in range(3):
                packed[done, c] = tried[t, c]
            done += 1
    return done


@compiled
def _cell(place: Array, low: Array, cell: float, sides: Array, at: Array) -> None:
    for k in range(3):
        at[k] = min(max(int((place[k] - low[k]) / cell), 0), sides[k] - 1)

"""Pairs of particles that are near to each other, by cells of a grid that is folded where particles are far apart."""

import math

import numpy as np

from anysim.conventions import Array
from anysim_particles.kernels.compiling import compiled

ROWS = 5
"""Of three cells each, of the nine around a cell and with it: pairs are found once."""


@compiled
def _sides(p: Array, n: int, cell: float, low: Array, sides: Array) -> None:
    """The lowest corner of the particles, and the number of cells along each side."""
    for k in range(3):
        a, b = np.inf, -np.inf
        for i in range(n):
            a, b = min(a, p[i, k]), max(b, p[i, k])
        low[k] = a
        wide = (b - a) / cell + 1.0
        sides[k] = 3 if not wide > 3.0 else (128 if wide > 128.0 else int(wide))
    while sides[0] * sides[1] * sides[2] > 8 * n + 64:
        k = 0 if sides[0] >= sides[1] and sides[0] >= sides[2] else (1 if sides[1] >= sides[2] else 2)
        if sides[k] <= 3:
            break
        sides[k] = max(3, sides[k] // 2)


@compiled
def _place(p: Array, n: int, cell: float, low: Array, at: Array) -> None:
    for i in range(n):
        for k in range(3):
            at[i, k] = math.floor((p[i, k] - low[k]) / cell)


@compiled
def _start(at: Array, n: int, sides: Array, home: Array, begin: Array, order: Array) -> None:
    """Sort particles by cell: those of cell c are order[begin[c]:begin[c + 1]]."""
    for c in range(begin.shape[0]):
        begin[c] = 0
    for i in range(n):
        c = at[i, 0] % sides[0] + sides[0] * (at[i, 1] % sides[1] + sides[1] * (at[i, 2] % sides[2]))
        home[i] = c
        begin[c + 1] += 1
    for c in range(begin.shape[0] - 1):
        begin[c + 1] += begin[c]
    fill = np.empty(begin.shape[0], dtype=np.int64)
    for c in range(begin.shape[0]):
        fill[c] = begin[c]
    for i in range(n):
        order[fill[home[i]]] = i
        fill[home[i]] += 1


@compiled
def sorted_by_cell(p: Array, n: int, cell: float) -> Array:
    """The particles (n,) int64 in the order of their cells: neighbours come to lie near to each other in memory."""
    low, sides = np.empty(3), np.empty(3, dtype=np.int64)
    _sides(p, n, cell, low, sides)
    at = np.empty((n, 3), dtype=np.int64)
    _place(p, n, cell, low, at)
    home, order = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    begin = np.zeros(sides[0] * sides[1] * sides[2] + 1, dtype=np.int64)
    _start(at, n, sides, home, begin, order)
    return order


@compiled
def in_order(rows: Array, order: Array) -> Array:
    """The chosen rows (n, 3), copied."""
    chosen = np.empty((order.shape[0], 3))
    for i in range(order.shape[0]):
        for k in range(3):
            chosen[i, k] = rows[order[i], k]
    return chosen


@compiled
def put_back(rows: Array, order: Array, chosen: Array) -> None:
    """Write the chosen rows (n, 3) to where they came from."""
    for i in range(order.shape[0]):
        for k in range(3):
            rows[order[i], k] = chosen[i, k]


@compiled
def _grown(pairs: Array) -> Array:
    more = np.empty((2 * pairs.shape[0], 2), dtype=np.int32)
    for q in range(pairs.shape[0]):
        more[q, 0], more[q, 1] = pairs[q, 0], pairs[q, 1]
    return more


@compiled
def near_pairs(p: Array, n: int, reach: float, pairs: Array) -> tuple[Array, int]:
    """Pairs of particles that are less than `reach` [m] apart.

    Args:
        p: (n or more, 3) [m].
        n: how many of them count.
        reach: also the width of the cells.
        pairs: (capacity, 2) int32 written; another one is returned where it is too small.

    Returns:
        The array, and how many of its rows are pairs.
    """
    low, sides = np.empty(3), np.empty(3, dtype=np.int64)
    _sides(p, n, reach, low, sides)
    at = np.empty((n, 3), dtype=np.int64)
    _place(p, n, reach, low, at)
    home, order = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    begin = np.zeros(sides[0] * sides[1] * sides[2] + 1, dtype=np.int64)
    _start(at, n, sides, home, begin, order)
    sorted_p, count, square = in_order(p, order), 0, reach * reach
    for a in range(n):
        i, c = order[a], home[order[a]]
        x, y, z = sorted_p[a, 0], sorted_p[a, 1], sorted_p[a, 2]
        u, v, w = c % sides[0], c // sides[0] % sides[1], c // (sides[0] * sides[1])
        for row in range(ROWS):  # of three cells; of its own those that come after it
            dy, dz = (row, 0) if row < 2 else (row - 3, 1)
            line = sides[0] * ((v + dy) % sides[1] + sides[1] * ((w + dz) % sides[2]))
            west, east = u - (row > 0), u + 1
            for beyond in range(2):  # what of a row is beyond one end of the grid is at the other
                if beyond == 0:
                    first, last = max(west, 0), min(east, sides[0] - 1)
                elif west < 0:
                    first = last = sides[0] - 1
                elif east == sides[0]:
                    first = last = 0
                else:
                    break
                start, stop = begin[line + first], begin[line + last + 1]
                if row == 0 and beyond == 0:
                    start = a + 1
                while count + stop - start > pairs.shape[0]:
                    pairs = _grown(pairs)
                for b in range(start, stop):  # without a branch: one in eight is near, and which cannot be foretold
                    e, f, g = x - sorted_p[b, 0], y - sorted_p[b, 1], z - sorted_p[b, 2]
                    pairs[count, 0], pairs[count, 1] = i, order[b]
                    count += e * e + f * f + g * g < square
    return pairs, count

"""Compiled hybrid A*: ways of a car, of arcs forwards and backwards, over a field of distances."""

import heapq
import math

import numpy as np

from anysim.conventions import Array
from anysim.math.compiled import compiled
from anysim_navigation.kernels.window import distance_at

YAWS = 48
"""Headings that are told apart."""
CELL = 0.1
"""[m] places that are told apart."""
BACKWARDS, SHIFT, STEERED, CLOSE = 1.6, 0.6, 0.05, 1.5
"""What a metre backwards counts for, a change of direction [m], one of steering [m], and a metre within a margin."""
MOST = 400_000
"""States that are looked at."""


@compiled
def distances_to(free: Array, row: int, column: int) -> Array:
    """(rows, columns) cells to a cell along free ones, eight neighbours each; inf where there is no way."""
    rows, columns = free.shape
    found = np.full((rows, columns), np.inf)
    found[row, column] = 0.0
    heap = [(0.0, row * columns + column)]
    while len(heap) > 0:
        cost, index = heapq.heappop(heap)
        i, j = index // columns, index % columns
        if cost > found[i, j]:
            continue
        for di in range(-1, 2):
            for dj in range(-1, 2):
                u, v = i + di, j + dj
                if not (0 <= u < rows and 0 <= v < columns) or not free[u, v]:
                    continue
                new = cost + math.sqrt(di * di + dj * dj)
                if new < found[u, v] - 1e-12:
                    found[u, v] = new
                    heapq.heappush(heap, (new, u * columns + v))
    return found


@compiled
def room_at(field: Array, cell: float, discs: Array, x: float, y: float, yaw: float) -> float:
    """[m] between the discs at a pose and what is nearest, over a field whose middle is the origin."""
    c, s, least = math.cos(yaw), math.sin(yaw), np.inf
    for d in range(len(discs)):
        px, py = x + c * discs[d, 0] - s * discs[d, 1], y + s * discs[d, 0] + c * discs[d, 1]
        least = min(least, distance_at(field, cell, px, py) - 0.5 * cell - discs[d, 2])
    return least


@compiled
def way_of_a_car(
    field: Array,
    cell: float,
    ahead: Array,
    discs: Array,
    radius: float,
    start: Array,
    goal: Array,
    near: float,
    margin: float,
) -> Array:
    """Poses and directions (K, 4): x, y, yaw and 1 or -1, from the start to within `near` [m] of the goal, or none.

    `ahead` (rows, columns) [m] says how far the goal is from each cell of the field at least; the field's middle is the
    origin. The heading at the goal is free.
    """
    rows, columns = field.shape
    wide, high = int(columns * cell / CELL) + 1, int(rows * cell / CELL) + 1
    count = wide * high * YAWS
    cost, came = np.full(count, np.inf), np.full(count, -1, dtype=np.int64)
    pose, gear = np.empty((count, 3)), np.zeros(count, dtype=np.int64)
    bend, done = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.bool_)
    step, parts = 1.5 * CELL, 3

    first = _index(start[0], start[1], start[2], columns * cell, rows * cell, wide, high)
    cost[first] = 0.0
    pose[first, 0], pose[first, 1], pose[first, 2] = start[0], start[1], start[2]
    floor = min(0.02, room_at(field, cell, discs, start[0], start[1], start[2])) - 1e-9
    heap = [(0.0, first)]
    looked, last = 0, -1
    while len(heap) > 0 and looked < MOST:
        _, here = heapq.heappop(heap)
        if done[here]:
            continue
        done[here] = True
        looked += 1
        x0, y0, yaw0 = pose[here, 0], pose[here, 1], pose[here, 2]
        if math.hypot(goal[0] - x0, goal[1] - y0) < near:
            last = here
            break
        for direction in (1, -1):
            for turn in range(-2, 3):
                curvature = 0.5 * turn / radius
                x, y, yaw, free, tight = x0, y0, yaw0, True, 0.0
                for _ in range(parts):
                    run = direction * step / parts
                    middle = yaw + 0.5 * curvature * run
                    x, y, yaw = x + run * math.cos(middle), y + run * math.sin(middle), yaw + curvature * run
                    room = room_at(field, cell, discs, x, y, yaw)
                    if room < floor:
                        free = False
                        break
                    tight += max(0.0, margin - room) / margin / parts
                index = _index(x, y, yaw, columns * cell, rows * cell, wide, high)
                if not free or index < 0 or done[index]:
                    continue
                new = cost[here] + step * (1.0 if direction > 0 else BACKWARDS) * (1.0 + CLOSE * tight)
                new += SHIFT if gear[here] * direction < 0 else 0.0
                new += STEERED if bend[here] != turn else 0.0
                if new < cost[index] - 1e-9:
                    i = min(rows - 1, max(0, int(y / cell + 0.5 * rows)))
                    j = min(columns - 1, max(0, int(x / cell + 0.5 * columns)))
                    if ahead[i, j] == np.inf:
                        continue
                    cost[index], came[index], gear[index], bend[index] = new, here, direction, turn
                    pose[index, 0], pose[index, 1], pose[index, 2] = x, y, yaw
                    heapq.heappush(heap, (float(new + ahead[i, j]), index))  # pyright: ignore[reportArgumentType]
    length, here = 0, last
    while here >= 0:
        length, here = length + 1, came[here]
    found = np.empty((length, 4))
    here = last
    for k in range(length - 1, -1, -1):
        found[k, 0], found[k, 1], found[k, 2], found[k, 3] = pose[here, 0], pose[here, 1], pose[here, 2], gear[here]
        here = came[here]
    return found


@compiled
def _index(x: float, y: float, yaw: float, width: float, height: float, wide: int, high: int) -> int:
    j, i = math.floor((x + 0.5 * width) / CELL), math.floor((y + 0.5 * height) / CELL)
    if not (0 <= i < high and 0 <= j < wide):
        return -1
    k = math.floor((yaw % (2 * math.pi)) / (2 * math.pi) * YAWS) % YAWS
    return int((i * wide + j) * YAWS + k)

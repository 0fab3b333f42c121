"""Compiled rollouts of the dynamic window: velocities within reach, followed for a while and scored by critics."""

import math

import numpy as np

from anysim.conventions import Array
from anysim.math.compiled import compiled

PATH, GOAL, OBSTACLE, OSCILLATION, VELOCITY, HEADING = range(6)
"""Places of the critics' weights."""
FAR = 10.0
"""[m] the distance of what is beyond the grid."""
SETTLED = 0.1
"""[m] from the point that is aimed at no heading is asked for."""


@compiled
def distance_at(field: Array, cell: float, x: float, y: float) -> float:
    """[m] between the middles of cells of a field about the origin; FAR beyond it."""
    rows, columns = field.shape
    u, v = x / cell + 0.5 * columns - 0.5, y / cell + 0.5 * rows - 0.5
    if u < 0.0 or v < 0.0 or u >= columns - 1 or v >= rows - 1:
        return FAR
    j, i = int(u), int(v)
    a, b = u - j, v - i
    low = (1 - a) * field[i, j] + a * field[i, j + 1]
    high = (1 - a) * field[i + 1, j] + a * field[i + 1, j + 1]
    return (1 - b) * low + b * high


@compiled
def clearances(
    field: Array, cell: float, discs: Array, movers: Array, x: float, y: float, yaw: float, time: float
) -> tuple[float, float]:
    """[m] from a base at a pose to what is nearest, and to the nearest mover in a time [s]; below 0 they overlap.

    `movers` (M, 5) are discs with their velocities, x, y, vx, vy and radius, which go on as they do now.
    """
    cosine, sine, least, apart = math.cos(yaw), math.sin(yaw), FAR, FAR
    for d in range(len(discs)):
        px, py = x + cosine * discs[d, 0] - sine * discs[d, 1], y + sine * discs[d, 0] + cosine * discs[d, 1]
        least = min(least, distance_at(field, cell, px, py) - 0.5 * cell - discs[d, 2])
        for m in range(len(movers)):
            dx, dy = movers[m, 0] + time * movers[m, 2] - px, movers[m, 1] + time * movers[m, 3] - py
            both = movers[m, 4] + discs[d, 2]
            if dx * dx + dy * dy < (apart + both) * (apart + both):  # it is nearer than those before
                apart = math.sqrt(dx * dx + dy * dy) - both
    return least, apart


@compiled
def line_is_free(field: Array, cell: float, radius: float, x: float, y: float) -> bool:
    """Whether a disc of a radius [m] gets straight from the origin to a point, but for what it overlaps already."""
    steps = max(1, math.ceil(math.hypot(x, y) / cell))
    floor = min(0.0, distance_at(field, cell, 0.0, 0.0) - 0.5 * cell - radius)
    for k in range(1, steps + 1):
        if distance_at(field, cell, k * x / steps, k * y / steps) - 0.5 * cell - radius < floor:
            return False
    return True


@compiled
def distance_to_path(path: Array, x: float, y: float) -> float:
    """[m] from a point to a way (K, 2)."""
    best = math.hypot(path[0, 0] - x, path[0, 1] - y)
    for k in range(len(path) - 1):
        ax, ay = path[k, 0], path[k, 1]
        ex, ey = path[k + 1, 0] - ax, path[k + 1, 1] - ay
        square = ex * ex + ey * ey
        share = 0.0 if square == 0.0 else min(1.0, max(0.0, ((x - ax) * ex + (y - ay) * ey) / square))
        best = min(best, math.hypot(ax + share * ex - x, ay + share * ey - y))
    return best


@compiled
def between(angle: float) -> float:
    """[rad] of a difference of headings, from 0 to half a turn."""
    return abs(math.atan2(math.sin(angle), math.cos(angle)))


@compiled
def looks_past(aim: Array, x: float, y: float, yaw: float) -> float:
    """[rad] between where a pose looks and a point, from 0 to half a turn."""
    return between(math.atan2(aim[1] - y, aim[0] - x) - yaw)


@compiled
def toward(now: float, wanted: float, most: float) -> float:
    """A value as near to the wanted one as it gets by `most`."""
    return now + min(most, max(-most, wanted - now))


@compiled
def _of_window(low: float, high: float, index: int, count: int) -> float:
    """One of the velocities of a window; the one nearest to rest is rest where the window holds it."""
    if count == 1:
        return min(high, max(low, 0.0))
    step = (high - low) / (count - 1)
    value = low + step * index
    return 0.0 if low <= 0.0 <= high and abs(value) < 0.5 * step else value


@compiled
def choose(
    field: Array,
    cell: float,
    discs: Array,
    movers: Array,
    path: Array,
    aim: Array,
    now: Array,
    last: Array,
    low: Array,
    high: Array,
    acceleration: Array,
    turning_radius: float,
    samples: Array,
    weights: Array,
    timing: Array,
    margin: float,
    out: Array,
) -> tuple[float, float]:
    """The best velocity within reach, into `out` (3,); its cost (inf where all run into something), the clearance now.

    All is in the frame of the base as it is now. `aim` (2,) [m] is the point of the way that it makes for, `now` and
    `last` (3,) its velocity and what it was told, `timing` the step, the horizon and the window [s].
    """
    step, horizon, window = timing[0], timing[1], timing[2]
    steps = round(horizon / step)
    stood = [clearances(field, cell, discs, movers, 0.0, 0.0, 0.0, k * step) for k in range(steps + 1)]
    floor = min(0.0, stood[0][0]) - 1e-9  # what is too near already may go, but not nearer
    fastest_way = max(high[0], -low[0])
    best, out[0], out[1], out[2] = np.inf, 0.0, 0.0, 0.0
    bottom, top = np.empty(3), np.empty(3)
    for k in range(3):
        held = min(high[k], max(low[k], now[k]))
        bottom[k] = max(low[k], held - acceleration[k] * window)
        top[k] = min(high[k], held + acceleration[k] * window)
    for a in range(samples[0]):
        forward = _of_window(bottom[0], top[0], a, samples[0])
        for b in range(samples[1]):
            aside = _of_window(bottom[1], top[1], b, samples[1])
            slowest, fastest = bottom[2], top[2]
            if turning_radius > 0.0:  # a car's turns follow from its speed, so that at any it has its tightest ones
                tightest = abs(forward) / turning_radius
                slowest = min(tightest, max(-tightest, slowest))
                fastest = max(-tightest, min(tightest, fastest))
            for c in range(samples[2] if slowest < fastest else 1):
                turn = _of_window(slowest, fastest, c, samples[2])
                x, y, yaw = 0.0, 0.0, 0.0
                vx, vy, w = now[0], now[1], now[2]
                speed = math.hypot(forward, aside)
                braking = max(speed / acceleration[0], abs(turn) / acceleration[2]) + 2 * step
                near, hit, free = 0.0, 0.0, True
                for k in range(1, steps + 1):
                    vx = toward(vx, forward, acceleration[0] * step)
                    vy = toward(vy, aside, acceleration[1] * step)
                    w = toward(w, turn, acceleration[2] * step)
                    middle = yaw + 0.5 * w * step
                    x += (vx * math.cos(middle) - vy * math.sin(middle)) * step
                    y += (vx * math.sin(middle) + vy * math.cos(middle)) * step
                    yaw += w * step
                    time = k * step
                    room, apart = clearances(field, cell, discs, movers, x, y, yaw, time)
                    nearer = apart < min(0.0, stood[k][1]) - 1e-9  # to who moves than if the base stood
                    if (room < floor or nearer) and time <= braking:
                        free = False
                        break
                    if room < 0.0 or nearer:
                        hit = 1.0 - time / horizon + 0.2
                        break
                    near += max(0.0, margin - min(room, apart)) / margin
                if not free:
                    continue
                left = math.hypot(aim[0] - x, aim[1] - y)
                off = 0.0
                if left > SETTLED:
                    off = looks_past(aim, x, y, yaw)
                if turning_radius > 0.0 and forward < 0.0:
                    off = math.pi - off  # a car that goes backwards looks away from where it goes
                flips = (1.0 if turn * last[2] < -0.01 else 0.0) + (1.0 if forward * last[0] < -1e-3 else 0.0)
                flips += 1.0 if aside * last[1] < -1e-3 else 0.0
                cost = (
                    weights[PATH] * distance_to_path(path, x, y)
                    + weights[GOAL] * left
                    + weights[OBSTACLE] * (near / steps + 4.0 * hit)
                    + weights[OSCILLATION] * flips
                    + weights[VELOCITY] * (1.0 - speed / fastest_way)
                    + weights[HEADING] * off
                )
                if cost < best:
                    best, out[0], out[1], out[2] = cost, forward, aside, turn
    return best, min(stood[0][0], stood[0][1])

"""Compiled search over space and time: motions in a row, of which the most promising are gone on with."""

import math

import numpy as np

from anysim.conventions import Array
from anysim.math.compiled import compiled
from anysim_navigation.kernels.window import SETTLED, between, clearances, distance_at, looks_past, toward

CONTACT, CLOSER, NEAR, TIGHT, TURN, HEADING, LATE, BACK = range(8)
"""Places of the weights."""
X, Y, YAW, SPEED, ASIDE, RATE, SPENT, MOTIONS = range(8)
"""Columns of a node: where it is, how fast, what its motions have cost, and from there on which they were."""
PLACE, ANGLE = 0.12, 0.4
"""[m], [rad] within which two nodes are one, if both go forwards, backwards or hardly at all, and so to their sides."""
ENOUGH = 0.05
"""[m] from what is made for it is reached: motions that end nearer to it, and begin later for that, are no better."""
MOVERS, CLOSE, THINGS, KEPT = range(4)
"""Places of the margins."""


@compiled
def cell_of(node: Array) -> int:
    """What nodes have in common of which the better one is enough."""
    i, j = math.floor(node[X] / PLACE) + 500, math.floor(node[Y] / PLACE) + 500
    yaw = math.atan2(math.sin(node[YAW]), math.cos(node[YAW]))
    turned = math.floor(yaw / ANGLE) + 10
    goes = 1 if node[SPEED] > 0.15 else (2 if node[SPEED] < -0.1 else 0)
    aside = 1 if node[ASIDE] > 0.15 else (2 if node[ASIDE] < -0.15 else 0)
    return (((i * 1000 + j) * 20 + turned) * 3 + goes) * 3 + aside


@compiled
def remaining(node: Array, aim: Array, togo: Array, size: float, gear: float, heading: float) -> float:
    """[m] from a node to what is made for, and what it looks past it; `gear` is -1 for who comes backwards.

    It is `aim` in a straight line, or where there is a field `togo`, of cells of so many metres, what that says.
    """
    x, y = node[X], node[Y]
    if len(togo) == 0:
        left = max(0.0, math.hypot(aim[0] - x, aim[1] - y) - ENOUGH)
        off = looks_past(aim, x, y, node[YAW])
    else:
        left = distance_at(togo, size, x, y)
        further = distance_at(togo, size, x + size, y) - distance_at(togo, size, x - size, y)
        aside = distance_at(togo, size, x, y + size) - distance_at(togo, size, x, y - size)
        off = between(math.atan2(-aside, -further) - node[YAW])
    if left <= SETTLED:
        return left
    return left + heading * (off if gear >= 0.0 else math.pi - off)


@compiled
def search(
    field: Array,
    cell: float,
    discs: Array,
    movers: Array,
    aim: Array,
    togo: Array,
    size: float,
    now: Array,
    last: float,
    motions: Array,
    curved: bool,
    acceleration: Array,
    gear: float,
    plan: Array,
    past: int,
    weights: Array,
    margins: Array,
    step: float,
    steps: int,
    fine: int,
    depth: int,
    width: int,
) -> tuple[Array, float]:
    """The motions (depth,) to go through, -1 from where all run into something; and their cost [m].

    All is in the frame of the base as it is now. `motions` (K, 3) are speeds forward and to the left [m/s] with turns
    [rad/s], or where `curved` with curvatures [1/m]; each lasts so many `steps` of `step` [s], twice that from the one
    numbered `fine` on, and `depth` of them follow one another. `last` [m/s] is the speed of the motion that was chosen
    last.

    `plan` (depth,) are motions of which the first is under way for `past` steps, -1 where there are none. Nothing
    better crowds them out before their end is looked at: so what was meant last is given up for what is better alone,
    and not because this time it was not found.
    """
    count = len(motions)
    floor = min(margins[KEPT], clearances(field, cell, discs, movers[:0], 0.0, 0.0, 0.0, 0.0)[0]) - 1e-6
    size_of_node = MOTIONS + depth
    kept, meant = np.zeros((1, size_of_node)), True
    kept[0, SPEED], kept[0, ASIDE], kept[0, RATE] = now[0], now[1], now[2]
    chosen, cost, begun = np.full(depth, -1), np.inf, 0.0
    for level in range(depth):
        h = step if level < fine else 2.0 * step
        ticks = steps - past if level == 0 else steps
        nodes, scores, found = np.empty((len(kept) * count, size_of_node)), np.empty(len(kept) * count), 0
        planned = -1
        for i in range(len(kept)):
            for k in range(count):
                node = nodes[found]
                node[:] = kept[i]
                node[MOTIONS + level] = k
                if level == 0 and last * motions[k, 0] < 0.0:
                    node[SPENT] += weights[BACK]
                free = True
                for n in range(ticks):
                    node[SPEED] = toward(node[SPEED], motions[k, 0], acceleration[0] * h)
                    node[ASIDE] = toward(node[ASIDE], motions[k, 1], acceleration[1] * h)
                    turn = motions[k, 2] * (node[SPEED] if curved else 1.0)
                    node[RATE] = toward(node[RATE], turn, acceleration[2] * h)
                    middle = node[YAW] + 0.5 * node[RATE] * h
                    x, y, yaw = node[X], node[Y], node[YAW]
                    c, s = math.cos(middle), math.sin(middle)
                    node[X] += (c * node[SPEED] - s * node[ASIDE]) * h
                    node[Y] += (s * node[SPEED] + c * node[ASIDE]) * h
                    node[YAW] += node[RATE] * h
                    time = begun + (n + 1) * h
                    room, apart = clearances(field, cell, discs, movers, node[X], node[Y], node[YAW], time)
                    if room < floor:
                        free = False
                        break
                    if weights[CLOSER] > 0.0 and apart < margins[CLOSE]:
                        stood = clearances(field, cell, discs, movers, x, y, yaw, time)[1]
                        node[SPENT] += weights[CLOSER] * max(0.0, min(margins[CLOSE], stood) - apart)
                    if apart < 0.0:
                        node[SPENT] += weights[CONTACT] * h * (1.0 - apart / 0.2)
                    elif apart < margins[MOVERS]:
                        node[SPENT] += weights[NEAR] * h * (1.0 - apart / margins[MOVERS])
                    if room < margins[THINGS]:
                        node[SPENT] += weights[TIGHT] * h * (1.0 - room / margins[THINGS])
                    node[SPENT] += weights[TURN] * h * abs(node[RATE])
                if free:
                    if meant and i == 0 and k == plan[level]:
                        planned = found
                    left = remaining(node, aim, togo, size, gear, weights[HEADING])
                    node[SPENT] += weights[LATE] * h * ticks * left  # else it could as well go there later
                    scores[found] = node[SPENT] + left
                    found += 1
        if found == 0:
            break
        order, seen = np.argsort(scores[:found]), {-1}
        best, length, meant = np.empty((width + 1, size_of_node)), 0, planned >= 0
        if meant:
            seen.add(cell_of(nodes[planned]))
            best[0], length = nodes[planned], 1
        for index in order:
            key = cell_of(nodes[index])
            if key not in seen:
                seen.add(key)
                best[length] = nodes[index]
                length += 1
                if length == width + meant:
                    break
        kept = best[:length].copy()
        for n in range(level + 1):
            chosen[n] = int(nodes[order[0], MOTIONS + n])
        cost, begun = float(scores[order[0]]), begun + ticks * h
    return chosen, cost

"""Compiled boxes: those around posed geoms, and trees of boxes over geoms or triangles.

A tree is depth first: the left child is the next node. Boxes are a little larger than what is in them, so that no
rounding of a test against them loses anything.
"""

from functools import partial

import numpy as np

from anysim.conventions import Array
from anysim.math.compiled import compiled as in_numba
from anysim_sensors.tables import BOX, CAPSULE, CYLINDER, PLANE, SPHERE, GeomPoses, Geoms

compiled = partial(in_numba, nogil=True)
"""The decorator of all kernels."""
guarded = partial(in_numba, nogil=True, error_model="numpy")
"""And of those that never divide by zero, which need not look whether they do: loops of them take several at once."""

BINS = 16
DEEPEST = 60
"""Levels from which on a tree is split into halves: the stack of a traversal has room for 128."""
ENDLESS = 1e9
"""[m] where the box of what has no end ends."""


@compiled
def slack(value: float) -> float:
    """How much further [m] a box reaches than what is in it, at a coordinate."""
    return 1e-9 + 1e-12 * abs(value)


@compiled
def _enclose(low: Array, high: Array, order: Array, first: int, last: int, box: Array) -> None:
    """The box around the items order[first:last]."""
    for k in range(3):
        a, b = low[order[first], k], high[order[first], k]
        for i in range(first + 1, last):
            a, b = min(a, low[order[i], k]), max(b, high[order[i], k])
        box[k], box[3 + k] = a - slack(a), b + slack(b)


@compiled
def _half_area(counted: Array, bin: int) -> float:
    x = counted[bin, 4] - counted[bin, 1]
    y = counted[bin, 5] - counted[bin, 2]
    z = counted[bin, 6] - counted[bin, 3]
    return x * y + y * z + z * x


@compiled
def _join(counted: Array, into: int, other: int) -> None:
    counted[into, 0] += counted[other, 0]
    for k in range(1, 4):
        counted[into, k] = min(counted[into, k], counted[other, k])
        counted[into, 3 + k] = max(counted[into, 3 + k], counted[other, 3 + k])


@compiled
def _cut(low: Array, high: Array, order: Array, first: int, last: int, halves: bool, bins: Array, right: Array) -> int:
    """Reorder order[first:last], and say where the second part begins: the best of 16 cuts by the surface areas."""
    axis, widest, start = 0, -1.0, 0.0
    for k in range(3):
        a, b = np.inf, -np.inf
        for i in range(first, last):
            middle = low[order[i], k] + high[order[i], k]
            a, b = min(a, middle), max(b, middle)
        if b - a > widest:
            axis, widest, start = k, b - a, a
    if halves or not widest > 0.0:
        return (first + last) // 2
    scale = BINS / widest
    for bin in range(BINS):
        bins[bin, 0] = 0.0
        for k in range(3):
            bins[bin, 1 + k], bins[bin, 4 + k] = np.inf, -np.inf
    for i in range(first, last):
        item = order[i]
        bin = min(int((low[item, axis] + high[item, axis] - start) * scale), BINS - 1)
        bins[bin, 0] += 1.0
        for k in range(3):
            bins[bin, 1 + k] = min(bins[bin, 1 + k], low[item, k])
            bins[bin, 4 + k] = max(bins[bin, 4 + k], high[item, k])
    for bin in range(BINS):  # a copy of a whole array takes numba a second to compile, for what it says of other shapes
        for k in range(7):
            right[bin, k] = bins[bin, k]
    for bin in range(BINS - 2, -1, -1):
        _join(right, bin, bin + 1)
    best, cost = -1, np.inf
    for bin in range(BINS - 1):  # bins[bin] holds all up to it
        if bin > 0:
            _join(bins, bin, bin - 1)
        if bins[bin, 0] > 0.0 and right[bin + 1, 0] > 0.0:
            found = bins[bin, 0] * _half_area(bins, bin) + right[bin + 1, 0] * _half_area(right, bin + 1)
            if found < cost:
                best, cost = bin, found
    i, j = first, last - 1
    while i <= j:
        item = order[i]
        if min(int((low[item, axis] + high[item, axis] - start) * scale), BINS - 1) <= best:
            i += 1
        else:
            order[i], order[j] = order[j], item
            j -= 1
    return i if first < i < last else (first + last) // 2


@compiled
def build_tree(low: Array, high: Array, leaf: int, order: Array, count: int, box: Array, link: Array) -> int:
    """A tree over the items order[:count] with boxes from `low` to `high` (n, 3), at most `leaf` items in a leaf.

    `order` is written, and `box` (2 count, 6), `link` (2 count, 2); returns the number of nodes.
    """
    stack = np.empty((2 * DEEPEST + 64, 4), dtype=np.int64)  # first, last, the parent of a right child, depth
    bins, right = np.empty((BINS, 7)), np.empty((BINS, 7))
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = 0, count, -1, 0
    nodes, top = 0, 1 if count > 0 else 0
    while top > 0:
        top -= 1
        first, last, parent, depth = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
        if parent >= 0:
            link[parent, 1] = nodes
        _enclose(low, high, order, first, last, box[nodes])
        if last - first <= leaf:
            link[nodes, 0], link[nodes, 1] = last - first, first
        else:
            link[nodes, 0] = 0
            middle = _cut(low, high, order, first, last, depth >= DEEPEST, bins, right)
            stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = middle, last, nodes, depth + 1
            stack[top + 1, 0], stack[top + 1, 1], stack[top + 1, 2], stack[top + 1, 3] = first, middle, -1, depth + 1
            top += 2
        nodes += 1
    return nodes


@compiled
def _pose_geom(local: Array, pose: Array, out: Array) -> None:
    """A frame (12,) in that of a body at a pose (7,), as a frame of the world."""
    x, y, z, w = pose[3], pose[4], pose[5], pose[6]
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    for i in range(3):
        a, b, c = rows[i]
        for j in range(3):
            out[3 * i + j] = a * local[j] + b * local[3 + j] + c * local[6 + j]
        out[9 + i] = pose[i] + a * local[9] + b * local[10] + c * local[11]


@compiled
def _bound(geoms: Geoms, g: int, frame: Array, low: Array, high: Array) -> None:
    """The box around a posed geom."""
    kind, size = geoms.kind[g], geoms.size[g]
    for i in range(3):
        across, middle = 0.0, frame[9 + i]
        if kind == PLANE:
            across = ENDLESS
        elif kind == SPHERE:
            across = size[0]
        elif kind == BOX:
            across = abs(frame[3 * i]) * size[0] + abs(frame[3 * i + 1]) * size[1] + abs(frame[3 * i + 2]) * size[2]
        elif kind == CAPSULE:
            across = abs(frame[3 * i + 2]) * size[1] + size[0]
        elif kind == CYLINDER:
            z = frame[3 * i + 2]
            across = abs(z) * size[1] + size[0] * np.sqrt(max(0.0, 1.0 - z * z))
        else:
            for j in range(3):
                across += abs(frame[3 * i + j]) * 0.5 * (geoms.high[g, j] - geoms.low[g, j])
                middle += frame[3 * i + j] * 0.5 * (geoms.high[g, j] + geoms.low[g, j])
        a, b = middle - across, middle + across
        low[i], high[i] = a - slack(a), b + slack(b)
    if geoms.sheet[g]:  # what is below it is in it
        low[2] = -ENDLESS
    if kind == PLANE and frame[8] == 1.0:  # level
        high[2] = frame[11] + slack(frame[11])


@compiled
def pose_geoms(geoms: Geoms, body_pose: Array, presence: Array, posed: GeomPoses) -> None:
    """Write where the geoms are, with bodies at poses (N, B, 7) and entities (N, E) bool there or not."""
    world = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    for e in range(posed.frame.shape[0]):
        count = 0
        for g in range(posed.frame.shape[1]):
            body, entity = geoms.body[g], geoms.entity[g]
            _pose_geom(geoms.frame[g], world if body < 0 else body_pose[e, body], posed.frame[e, g])
            nothing = 0.0
            for k in range(12):
                nothing += 0.0 * posed.frame[e, g, k]
            # what is at a place that is no number is nowhere: an env that has failed costs the others nothing
            posed.there[e, g] = nothing == 0.0 and (entity < 0 or presence[e, entity])
            _bound(geoms, g, posed.frame[e, g], posed.low[e, g], posed.high[e, g])
            if posed.there[e, g]:
                posed.order[e, count] = g
                count += 1
        if posed.box.shape[1] > 0:
            if build_tree(posed.low[e], posed.high[e], 1, posed.order[e], count, posed.box[e], posed.link[e]) == 0:
                posed.link[e, 0, 0], posed.link[e, 0, 1] = 0, -1  # nothing is there

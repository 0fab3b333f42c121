"""Compiled images: what the rays of a camera met, as depths, points and boxes."""

import numpy as np

from anysim.conventions import Array
from anysim_sensors.kernels.bounds import compiled
from anysim_sensors.kernels.rays import turn_of


@compiled
def draw(
    distance: Array, number: Array, directions: Array, near: float, far: float, segment: Array, depth: Array, ids: Array
) -> None:
    """Depths along the optical axis and segmentation ids; what is beyond near or far is not seen.

    Args:
        distance: (N, R) [m] along rays, `number` (N, R) the geom or -1.
        number: see above; what is not seen is written as -1.
        directions: (N or 1, R, 3) in the optical frame, unit.
        near, far: [m] along the optical axis.
        segment: (geoms + 1,) int32 id of each geom.
        depth: (N, R) float32 written [m], inf where nothing is seen.
        ids: (N, R) int32 written.
    """
    for e in range(distance.shape[0]):
        p = e if directions.shape[0] > 1 else 0
        for r in range(distance.shape[1]):
            along = distance[e, r] * directions[p, r, 2]
            if number[e, r] >= 0 and not near <= along <= far:
                number[e, r] = -1
            depth[e, r] = along if number[e, r] >= 0 else np.inf
            ids[e, r] = segment[number[e, r]]


@compiled
def locate(distance: Array, number: Array, directions: Array, frames: Array, points: Array) -> None:
    """Points (N, R, 3) float32 [m] of the world, NaN where nothing is seen."""
    for e in range(distance.shape[0]):
        p, f = e if directions.shape[0] > 1 else 0, frames[e]
        turn = turn_of(f)
        for r in range(distance.shape[1]):
            t = distance[e, r] if number[e, r] >= 0 else np.nan
            u, v, w = t * directions[p, r, 0], t * directions[p, r, 1], t * directions[p, r, 2]
            for k in range(3):
                a, b, c = turn[k]
                points[e, r, k] = f[k] + (a * u + b * v + c * w)


@compiled
def surround(ids: Array, width: int, boxes: Array, area: Array) -> None:
    """Boxes (N, ids, 4) int32 around the pixels (N, R) of each id, and how many these are (N, ids) int32.

    A box is its first column and row, and those after its last; zeros where nothing is seen.
    """
    for e in range(ids.shape[0]):
        area[e] = 0
        boxes[e] = 0
        u, v = -1, 0
        for r in range(ids.shape[1]):
            i, u = ids[e, r], u + 1
            if u == width:
                u, v = 0, v + 1
            if area[e, i] == 0:
                boxes[e, i, 0], boxes[e, i, 1], boxes[e, i, 2], boxes[e, i, 3] = u, v, u + 1, v + 1
            else:
                boxes[e, i, 0], boxes[e, i, 1] = min(boxes[e, i, 0], u), min(boxes[e, i, 1], v)
                boxes[e, i, 2], boxes[e, i, 3] = max(boxes[e, i, 2], u + 1), max(boxes[e, i, 3], v + 1)
            area[e, i] += 1

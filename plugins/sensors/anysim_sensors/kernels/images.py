"""Compiled images: what the rays of a camera met, as depths, points, motion and boxes."""

import numpy as np

from anysim.conventions import Array
from anysim_sensors.kernels.bounds import compiled
from anysim_sensors.tables import GeomPoses


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
        x, y, z, w = f[3], f[4], f[5], f[6]
        turn = (
            (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
            (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
            (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
        )
        for r in range(distance.shape[1]):
            t = distance[e, r] if number[e, r] >= 0 else np.nan
            u, v, w = t * directions[p, r, 0], t * directions[p, r, 1], t * directions[p, r, 2]
            for k in range(3):
                a, b, c = turn[k]
                points[e, r, k] = f[k] + (a * u + b * v + c * w)


@compiled
def move(
    number: Array,
    points: Array,
    row: Array,
    posed: GeomPoses,
    before: GeomPoses,
    frames_before: Array,
    focal: Array,
    width: int,
    height: int,
    flow: Array,
) -> None:
    """How far [pixels] what is seen has come since before: (N, R, 2) float32 written, columns and rows.

    Args:
        number: (N, R) the geom or -1.
        points: (N, R, 3) [m] of the world.
        row: (geoms + 1,) int32, rows of the tables of geoms.
        posed: where geoms are now.
        before: where they were.
        frames_before: (N, 7) where the camera was.
        focal: (N,) [pixels] what it was then.
        width, height: of the image.
        flow: NaN where nothing is seen, and where it was behind the camera.
    """
    for e in range(number.shape[0]):
        f = frames_before[e]
        x, y, z, w = f[3], f[4], f[5], f[6]
        r00, r01, r02 = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
        r10, r11, r12 = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
        r20, r21, r22 = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
        for r in range(number.shape[1]):
            flow[e, r, 0], flow[e, r, 1] = np.nan, np.nan
            if number[e, r] < 0:
                continue
            a, b = posed.frame[e, row[number[e, r]]], before.frame[e, row[number[e, r]]]
            x, y, z = points[e, r, 0] - a[9], points[e, r, 1] - a[10], points[e, r, 2] - a[11]
            u = a[0] * x + a[3] * y + a[6] * z
            v = a[1] * x + a[4] * y + a[7] * z
            w = a[2] * x + a[5] * y + a[8] * z
            x = b[0] * u + b[1] * v + b[2] * w + b[9] - f[0]
            y = b[3] * u + b[4] * v + b[5] * w + b[10] - f[1]
            z = b[6] * u + b[7] * v + b[8] * w + b[11] - f[2]
            ahead = r02 * x + r12 * y + r22 * z
            if ahead > 0.0:
                column = (r00 * x + r10 * y + r20 * z) / ahead * focal[e] + width / 2 - 0.5
                line = (r01 * x + r11 * y + r21 * z) / ahead * focal[e] + height / 2 - 0.5
                flow[e, r, 0], flow[e, r, 1] = r % width - column, r // width - line


@compiled
def surround(ids: Array, width: int, boxes: Array, area: Array) -> None:
    """Boxes (N, ids, 4) int32 around the pixels (N, R) of each id, and how many these are (N, ids) int32.

    A box is its first column and row, and those after its last; zeros where nothing is seen.
    """
    for e in range(ids.shape[0]):
        area[e] = 0
        boxes[e] = 0
        for r in range(ids.shape[1]):
            i, u, v = ids[e, r], r % width, r // width
            if area[e, i] == 0:
                boxes[e, i, 0], boxes[e, i, 1], boxes[e, i, 2], boxes[e, i, 3] = u, v, u + 1, v + 1
            else:
                boxes[e, i, 0], boxes[e, i, 1] = min(boxes[e, i, 0], u), min(boxes[e, i, 1], v)
                boxes[e, i, 2], boxes[e, i, 3] = max(boxes[e, i, 2], u + 1), max(boxes[e, i, 3], v + 1)
            area[e, i] += 1

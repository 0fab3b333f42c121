"""Compiled motion of pixels: where what is seen was in the image before, and whether it could be seen there.

The shapes are crossed by the functions of `rays`, and found by those of `pinhole`: numba's cache of this file does not
notice a change of either.
"""

import math

import numpy as np

from anysim.conventions import Array
from anysim_sensors.kernels.bounds import compiled
from anysim_sensors.kernels.pinhole import find_window
from anysim_sensors.kernels.rays import cross_convex, cross_mesh, turn_of, turned
from anysim_sensors.tables import CYLINDER, PLANE, GeomPoses, Geoms, Triangles

TILES = 32
"""Across the longer side of an image: each knows the geoms that it may show."""
CLOSE = 1e-4
"""[m] What is nearer than this before a point is taken for its own surface."""


@compiled
def _fill(
    posed: GeomPoses,
    e: int,
    seen: Array,
    camera: Array,
    width: int,
    height: int,
    focal: float,
    shift: int,
    counts: Array,
    held: Array,
) -> None:
    """List in tiles of an image the geoms that may be seen there; `counts` (rows, columns), `held` (…, G) written."""
    window = np.empty(4, np.int64)
    counts[:] = 0
    for g in range(seen.shape[0]):
        if not (seen[g] and posed.there[e, g]):
            continue
        find_window(posed, e, g, camera, width, height, focal, window)
        if window[1] <= window[0] or window[3] <= window[2]:
            continue
        for i in range(window[2] >> shift, ((window[3] - 1) >> shift) + 1):
            for j in range(window[0] >> shift, ((window[1] - 1) >> shift) + 1):
                held[i, j, counts[i, j]] = g
                counts[i, j] += 1


@compiled
def follow(
    geoms: Geoms,
    triangles: Triangles,
    posed: GeomPoses,
    before: GeomPoses,
    seen: Array,
    row: Array,
    frames: Array,
    frames_before: Array,
    directions: Array,
    distance: Array,
    number: Array,
    focal: Array,
    width: int,
    near: float,
    far: float,
    flow: Array,
    appeared: Array,
) -> None:
    """How far [pixels] what is seen has come since before, and whether something hid it then.

    Args:
        geoms, triangles, posed, seen, frames, directions, focal, width, distance, number: as of `view`.
        before, frames_before: where geoms and the camera were.
        row: (geoms + 1,) int32, rows of the tables of geoms.
        near, far: [m] along the optical axis, of what could be seen.
        flow: (N, R, 2) float32 written, columns and rows; NaN where nothing is seen, and where it was behind the
            camera. Of 0 rows none is.
        appeared: (N, R) bool written: it was out of the image, or hidden. Of 0 rows none is.
    """
    size = directions.shape[1]
    height, geometries = size // width, seen.shape[0]
    shift = 3  # sides of tiles are powers of two: whole numbers are slow to divide
    while max(width, height) >> shift > TILES:
        shift += 1
    shape = (((height - 1) >> shift) + 1, ((width - 1) >> shift) + 1) if appeared.shape[0] > 0 else (0, 0)
    counts = np.empty(shape, np.int32)
    held = np.empty((shape[0], shape[1], geometries), np.int32)
    eye, away = np.empty((geometries, 3)), np.empty(geometries)
    stack, room = np.empty(128, np.int32), np.empty(128)
    box, link, corner = triangles.box, triangles.link, triangles.corner
    for e in range(frames.shape[0]):
        p = e if directions.shape[0] > 1 else 0
        f = focal[e if focal.shape[0] > 1 else 0]
        now, then, here, old = frames[e], frames_before[e], posed.frame[e], before.frame[e]
        (m00, m01, m02), (m10, m11, m12), (m20, m21, m22) = turn_of(now)
        (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = turn_of(then)
        if appeared.shape[0] > 0:
            _fill(before, e, seen, then, width, height, f, shift, counts, held)
            for g in range(geometries):
                x, y, z = then[0] - old[g, 9], then[1] - old[g, 10], then[2] - old[g, 11]
                eye[g, 0], eye[g, 1], eye[g, 2] = turned(old, g, x, y, z)
                away[g] = 0.0
                for k in range(3):
                    away[g] += max(before.low[e, g, k] - then[k], then[k] - before.high[e, g, k], 0.0) ** 2
                away[g] = math.sqrt(away[g])
        r, right, under = -1, -1, 0
        for _ in range(size):
            r, right = r + 1, right + 1
            if right == width:
                right, under = 0, under + 1
            if flow.shape[0] > 0:
                flow[e, r, 0], flow[e, r, 1] = np.nan, np.nan
            if appeared.shape[0] > 0:
                appeared[e, r] = False
            if number[e, r] < 0:
                continue
            own, t = row[number[e, r]], distance[e, r]
            u, v, w = t * directions[p, r, 0], t * directions[p, r, 1], t * directions[p, r, 2]
            a, b = here[own], old[own]
            x = now[0] + (m00 * u + m01 * v + m02 * w) - a[9]
            y = now[1] + (m10 * u + m11 * v + m12 * w) - a[10]
            z = now[2] + (m20 * u + m21 * v + m22 * w) - a[11]
            u = a[0] * x + a[3] * y + a[6] * z
            v = a[1] * x + a[4] * y + a[7] * z
            w = a[2] * x + a[5] * y + a[8] * z
            x = b[0] * u + b[1] * v + b[2] * w + b[9] - then[0]
            y = b[3] * u + b[4] * v + b[5] * w + b[10] - then[1]
            z = b[6] * u + b[7] * v + b[8] * w + b[11] - then[2]
            ahead = r02 * x + r12 * y + r22 * z
            column, line = -1.0, -1.0
            if ahead > 0.0:
                column = (r00 * x + r10 * y + r20 * z) / ahead * f + width / 2 - 0.5
                line = (r01 * x + r11 * y + r21 * z) / ahead * f + height / 2 - 0.5
                if flow.shape[0] > 0:
                    flow[e, r, 0], flow[e, r, 1] = right - column, under - line
            if appeared.shape[0] == 0:
                continue
            length = math.sqrt(x * x + y * y + z * z)
            if not 0.0 < length < np.inf:
                continue
            inside = near <= ahead <= far and -0.5 <= column <= width - 0.5 and -0.5 <= line <= height - 0.5
            appeared[e, r] = not inside
            if not inside:
                continue
            i, j = min(int(line + 0.5), height - 1) >> shift, min(int(column + 0.5), width - 1) >> shift
            scale, limit = 1.0 / length, length - CLOSE
            dx, dy, dz = x * scale, y * scale, z * scale
            for k in range(counts[i, j]):
                g = held[i, j, k]
                kind = geoms.kind[g]
                if away[g] >= limit or (kind == PLANE and g == own):  # a plane hides nothing of itself
                    continue
                u, v, w = turned(old, g, dx, dy, dz)
                if kind > CYLINDER:
                    root = triangles.root[geoms.mesh[g]]
                    t, _ = cross_mesh(
                        box, link, corner, root, eye[g, 0], eye[g, 1], eye[g, 2], u, v, w, limit, stack, room
                    )
                else:
                    s0, s1, s2 = geoms.size[g, 0], geoms.size[g, 1], geoms.size[g, 2]
                    t = cross_convex(kind, s0, s1, s2, eye[g, 0], eye[g, 1], eye[g, 2], u, v, w)
                if t < limit:
                    appeared[e, r] = True
                    break

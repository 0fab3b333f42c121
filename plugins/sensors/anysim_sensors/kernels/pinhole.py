"""Compiled images of pinhole cameras: geom by geom where it may be seen, so that many are cheap.

The shapes are crossed by the functions of `rays`: numba's cache of this file does not notice a change of those.
"""

import math

import numpy as np

from anysim.conventions import Array
from anysim_sensors.kernels.bounds import guarded
from anysim_sensors.kernels.rays import (
    cross_convex,
    cross_mesh,
    enter_box,
    gather,
    inverse,
    turn_of,
    turned,
    write_normal,
)
from anysim_sensors.tables import CYLINDER, PLANE, GeomPoses, Geoms, Triangles


@guarded
def find_window(
    posed: GeomPoses, e: int, g: int, camera: Array, width: int, height: int, focal: float, out: Array
) -> None:
    """The columns and rows, first and after the last, in which a geom may be seen, as far as its box tells."""
    out[0], out[1], out[2], out[3] = width, 0, height, 0
    x, y, z, w = camera[3], camera[4], camera[5], camera[6]
    behind = 0
    for corner in range(8):
        a = (posed.high if corner & 1 else posed.low)[e, g, 0] - camera[0]
        b = (posed.high if corner & 2 else posed.low)[e, g, 1] - camera[1]
        c = (posed.high if corner & 4 else posed.low)[e, g, 2] - camera[2]
        right = (1 - 2 * (y * y + z * z)) * a + 2 * (x * y + z * w) * b + 2 * (x * z - y * w) * c
        down = 2 * (x * y - z * w) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z + x * w) * c
        ahead = 2 * (x * z + y * w) * a + 2 * (y * z - x * w) * b + (1 - 2 * (x * x + y * y)) * c
        if ahead < 1e-6:
            behind += 1
            continue
        u = min(max(right / ahead * focal + width / 2 - 0.5, -1.0), width + 1.0)
        v = min(max(down / ahead * focal + height / 2 - 0.5, -1.0), height + 1.0)
        out[0], out[1] = min(out[0], max(math.floor(u), 0)), max(out[1], min(math.ceil(u) + 1, width))
        out[2], out[3] = min(out[2], max(math.floor(v), 0)), max(out[3], min(math.ceil(v) + 1, height))
    if behind == 8:
        out[1] = 0
    elif behind > 0:
        out[0], out[1], out[2], out[3] = 0, width, 0, height


@guarded
def _turn_rays(frame: Array, lines: Array, rays: Array) -> None:
    """Rays (6, R), directions and their inverses in the world, from directions (3, R) in the frame of a pose (7,)."""
    (a, b, c), (d, e, f), (g, h, i) = turn_of(frame)
    for r in range(lines.shape[1]):
        x, y, z = lines[0, r], lines[1, r], lines[2, r]
        u, v, w = a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z
        rays[0, r], rays[1, r], rays[2, r] = u, v, w
        rays[3, r], rays[4, r], rays[5, r] = inverse(u), inverse(v), inverse(w)


@guarded
def _in_order(
    geoms: Geoms, posed: GeomPoses, e: int, seen: Array, frame: Array, reach: float, keys: Array, candidates: Array
) -> int:
    """The geoms that are there, asked for and in reach, those of an entity next to each other; how many.

    So one mark a pixel tells whether an entity has it already.
    """
    count, most = 0, seen.shape[0]
    for g in range(most):
        if seen[g] and posed.there[e, g]:
            x = max(posed.low[e, g, 0] - frame[0], frame[0] - posed.high[e, g, 0], 0.0)
            y = max(posed.low[e, g, 1] - frame[1], frame[1] - posed.high[e, g, 1], 0.0)
            z = max(posed.low[e, g, 2] - frame[2], frame[2] - posed.high[e, g, 2], 0.0)
            if x * x + y * y + z * z <= reach * reach:
                key, k = (geoms.entity[g] + 1) * most + g, count
                while k > 0 and keys[k - 1] > key:  # they are nearly in order
                    keys[k] = keys[k - 1]
                    k -= 1
                keys[k] = key
                count += 1
    for k in range(count):
        candidates[k] = keys[k] % most
    return count


@guarded
def view(
    geoms: Geoms,
    triangles: Triangles,
    posed: GeomPoses,
    seen: Array,
    frames: Array,
    directions: Array,
    lines: Array,
    focal: Array,
    width: int,
    reach: float,
    far: float,
    distance: Array,
    number: Array,
    normal: Array,
    area: Array,
) -> None:
    """The same as `cast` for the pixels of a pinhole camera.

    Args:
        geoms, triangles, posed, seen, frames, reach, distance, number: as of `cast`.
        directions: (N or 1, R, 3) of the pixels in the optical frame, row by row.
        lines: (N or 1, 3, R) the same, made unit as `cast` does.
        focal: (N or 1,) [pixels].
        width: of the image.
        far: [m] along the optical axis; what is farther is not counted in the area.
        normal: (N, R, 3) written: outward, world frame, zeros where nothing is met. Of 0 rows none is.
        area: (N, entities + 1) int32 written, the pixels that each entity has with nothing in front of it, last what is
            of none. Of 0 rows none is.
    """
    most, size = seen.shape[0], lines.shape[2]
    rays, keys, candidates = np.empty((6, size)), np.empty(most, np.int64), np.empty(most, np.int32)
    window, level = np.empty(4, np.int64), np.zeros((most + 1, 3))  # the last row, -1, is of what is not met
    boxes, shapes = np.empty((most, 6)), np.empty((most, 15))
    chosen, which, last = np.empty(size, np.int32), np.empty(size, np.int32), np.empty(size, np.int32)
    stack, near = np.empty(128, np.int32), np.empty(128)
    box, link, corner = triangles.box, triangles.link, triangles.corner
    whole = area.shape[0] > 0
    for e in range(frames.shape[0]):
        p = e if lines.shape[0] > 1 else 0
        _turn_rays(frames[e], lines[p], rays)
        ox, oy, oz = frames[e, 0], frames[e, 1], frames[e, 2]
        count = _in_order(geoms, posed, e, seen, frames[e], reach, keys, candidates)
        gather(posed, e, geoms, candidates, count, boxes, shapes)
        chosen[:], which[:], last[:] = -1, -1, -2
        distance[e] = np.inf
        if whole:
            area[e] = 0
        for k in range(count):
            g = candidates[k]
            kind, entity = geoms.kind[g], geoms.entity[g]
            root = triangles.root[geoms.mesh[g]] if geoms.mesh[g] >= 0 else 0
            find_window(posed, e, g, frames[e], width, size // width, focal[p], window)
            a, b, c = turned(shapes, k, ox - shapes[k, 9], oy - shapes[k, 10], oz - shapes[k, 11])
            for row in range(window[2], window[3]):
                for r in range(row * width + window[0], row * width + window[1]):
                    best = min(distance[e, r], reach)
                    if kind != PLANE:  # all of the image is its window, and what is cheap to cross needs no box
                        entry = enter_box(boxes, k, ox, oy, oz, rays[3, r], rays[4, r], rays[5, r])
                        if entry > (reach if whole else best) or entry == np.inf:
                            continue
                    u, v, w = turned(shapes, k, rays[0, r], rays[1, r], rays[2, r])
                    triangle, limit = -1, reach if whole else best
                    if kind > CYLINDER:
                        t, triangle = cross_mesh(box, link, corner, root, a, b, c, u, v, w, limit, stack, near)
                    else:
                        t = cross_convex(kind, shapes[k, 12], shapes[k, 13], shapes[k, 14], a, b, c, u, v, w)
                    if t < best or (t == best and t < np.inf and (chosen[r] < 0 or g < candidates[chosen[r]])):
                        distance[e, r], chosen[r], which[r] = t, k, triangle
                    if whole and t < np.inf and t * directions[p, r, 2] <= far and last[r] != entity:
                        area[e, entity] += 1
                        last[r] = entity
        for r in range(size):
            k = chosen[r]
            number[e, r] = geoms.number[candidates[k]] if k >= 0 else -1
        if normal.shape[0] > 0:
            for k in range(count):
                if geoms.kind[candidates[k]] == PLANE:  # the same everywhere
                    write_normal(PLANE, corner, -1, shapes, k, 0.0, 0.0, 0.0, level, k)
            for r in range(size):
                k = chosen[r]
                kind = geoms.kind[candidates[k]] if k >= 0 else PLANE
                if kind == PLANE:
                    normal[e, r, 0], normal[e, r, 1], normal[e, r, 2] = level[k, 0], level[k, 1], level[k, 2]
                    continue
                t = distance[e, r]
                x, y, z = ox + t * rays[0, r], oy + t * rays[1, r], oz + t * rays[2, r]
                write_normal(kind, corner, which[r], shapes, k, x, y, z, normal[e], r)

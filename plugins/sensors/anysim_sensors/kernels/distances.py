"""Compiled signed distances of points to posed geoms, and the cells of a grid that are near to one.

Distances are negative inside, and come with the direction in which they grow.

Exact for shapes that have a formula. Of triangles it is the distance to the nearest one; its sign is that of the normal
there, which at edges and corners is the sum of their triangles' normals, at a corner weighted by their angles
(Baerentzen and Aanaes, 2005). Of geoms at the same distance the first of the World counts.
"""

import math

import numpy as np

from anysim.conventions import Array
from anysim_sensors.kernels.bounds import compiled
from anysim_sensors.tables import BOX, CAPSULE, CYLINDER, PLANE, SPHERE, GeomPoses, Geoms, Triangles

FEW = 96
"""Geoms up to which they are tried one after the other; more are found by a tree."""

Four = tuple[float, float, float, float]
"""A signed distance, and the direction in which it grows."""


@compiled
def _gap(a0: float, a1: float, a2: float, b0: float, b1: float, b2: float, x: float, y: float, z: float) -> float:
    """Squared distance of a point from the box from a to b, 0 inside."""
    u, v, w = a0 - x if x < a0 else 0.0, a1 - y if y < a1 else 0.0, a2 - z if z < a2 else 0.0
    u, v, w = x - b0 if x > b0 else u, y - b1 if y > b1 else v, z - b2 if z > b2 else w
    return u * u + v * v + w * w


@compiled
def _node(box: Array, i: int, x: float, y: float, z: float) -> float:
    return _gap(box[i, 0], box[i, 1], box[i, 2], box[i, 3], box[i, 4], box[i, 5], x, y, z)


@compiled
def _round(x: float, y: float, z: float, radius: float) -> Four:
    """From the surface of a ball; at its centre, up."""
    length = math.sqrt(x * x + y * y + z * z)
    if length > 0.0:
        return length - radius, x / length, y / length, z / length
    return -radius, 0.0, 0.0, 1.0


@compiled
def _box(x: float, y: float, z: float, s0: float, s1: float, s2: float) -> Four:
    a, b, c = abs(x) - s0, abs(y) - s1, abs(z) - s2
    if a > 0.0 or b > 0.0 or c > 0.0:
        u, v, w = max(a, 0.0), max(b, 0.0), max(c, 0.0)
        length = math.sqrt(u * u + v * v + w * w)
        return length, math.copysign(u / length, x), math.copysign(v / length, y), math.copysign(w / length, z)
    if a >= b and a >= c:
        return a, math.copysign(1.0, x), 0.0, 0.0
    if b >= c:
        return b, 0.0, math.copysign(1.0, y), 0.0
    return c, 0.0, 0.0, math.copysign(1.0, z)


@compiled
def _cylinder(x: float, y: float, z: float, radius: float, half: float) -> Four:
    rho = math.sqrt(x * x + y * y)
    ux, uy = (x / rho, y / rho) if rho > 0.0 else (1.0, 0.0)
    a, b = rho - radius, abs(z) - half
    if a > 0.0 and b > 0.0:
        length = math.sqrt(a * a + b * b)
        return length, ux * a / length, uy * a / length, math.copysign(b / length, z)
    if a > b:
        return a, ux, uy, 0.0
    return b, 0.0, 0.0, math.copysign(1.0, z)


@compiled
def convex(kind: int, s0: float, s1: float, s2: float, x: float, y: float, z: float) -> Four:
    """From the surface of a shape that has a formula, in its frame."""
    if kind == PLANE:
        return z, 0.0, 0.0, 1.0
    if kind == SPHERE:
        return _round(x, y, z, s0)
    if kind == CAPSULE:
        return _round(x, y, z - min(max(z, -s1), s1), s0)
    if kind == BOX:
        return _box(x, y, z, s0, s1, s2)
    return _cylinder(x, y, z, s0, s1)


@compiled
def _nearest(c: Array, i: int, x: float, y: float, z: float) -> tuple[float, float, float, int]:
    """From the nearest point of triangle i to a point, and which part that is on.

    0 is its inside, 1 to 3 an edge, 4 to 6 a corner. After Ericson, Real-Time Collision Detection, 5.1.5.
    """
    e0, e1, e2, f0, f1, f2 = c[i, 3], c[i, 4], c[i, 5], c[i, 6], c[i, 7], c[i, 8]
    x, y, z = x - c[i, 0], y - c[i, 1], z - c[i, 2]
    d1, d2 = e0 * x + e1 * y + e2 * z, f0 * x + f1 * y + f2 * z
    if d1 <= 0.0 and d2 <= 0.0:
        return x, y, z, 4
    ee, ef, ff = e0 * e0 + e1 * e1 + e2 * e2, e0 * f0 + e1 * f1 + e2 * f2, f0 * f0 + f1 * f1 + f2 * f2
    d3, d4, d5, d6 = d1 - ee, d2 - ef, d1 - ef, d2 - ff
    vc, vb, va = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    s, t, part = 0.0, 0.0, 0
    if d3 >= 0.0 and d4 <= d3:
        s, part = 1.0, 5
    elif d6 >= 0.0 and d5 <= d6:
        t, part = 1.0, 6
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        s, part = d1 / (d1 - d3), 1
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t, part = d2 / (d2 - d6), 3
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t, part = (d4 - d3) / ((d4 - d3) + (d5 - d6)), 2
        s = 1.0 - t
    elif va + vb + vc != 0.0:  # it is, of a triangle without an area
        s, t = vb / (va + vb + vc), vc / (va + vb + vc)
    return x - s * e0 - t * f0, y - s * e1 - t * f1, z - s * e2 - t * f2, part


@compiled
def _flat(c: Array, i: int) -> tuple[float, float, float]:
    """The unit normal of triangle i; zeros if it has no area."""
    x = c[i, 4] * c[i, 8] - c[i, 5] * c[i, 7]
    y = c[i, 5] * c[i, 6] - c[i, 3] * c[i, 8]
    z = c[i, 3] * c[i, 7] - c[i, 4] * c[i, 6]
    length = math.sqrt(x * x + y * y + z * z)
    return (x / length, y / length, z / length) if length > 0.0 else (0.0, 0.0, 0.0)


@compiled
def _normal(triangles: Triangles, i: int, part: int) -> tuple[float, float, float]:
    """The normal of a part of a triangle, of no particular length."""
    if part > 3:
        v = triangles.vertex[i, part - 4]
        return triangles.normal[v, 0], triangles.normal[v, 1], triangles.normal[v, 2]
    x, y, z = _flat(triangles.corner, i)
    if part > 0 and triangles.neighbour[i, part - 1] >= 0:
        u, v, w = _flat(triangles.corner, triangles.neighbour[i, part - 1])
        return x + u, y + v, z + w
    return x, y, z


@compiled
def meshed(
    triangles: Triangles, root: int, x: float, y: float, z: float, limit: float, stack: Array, near: Array
) -> Four:
    """From the nearest triangle of a mesh, in its frame, if it is within the limit; else inf."""
    box, link, corner = triangles.box, triangles.link, triangles.corner
    best, found, found_part = limit * limit, -1, 0
    bx, by, bz = 0.0, 0.0, 0.0
    stack[0], near[0], top = root, _node(box, root, x, y, z), 1
    while top > 0:
        top -= 1
        if near[top] > best:
            continue
        node = stack[top]
        count, to = link[node, 0], link[node, 1]
        if count > 0:
            for i in range(to, to + count):
                u, v, w, part = _nearest(corner, i, x, y, z)
                square = u * u + v * v + w * w
                if square < best or (found < 0 and square <= best):
                    best, found, found_part = square, i, part
                    bx, by, bz = u, v, w
            continue
        one, two = node + 1, to
        a, b = _node(box, one, x, y, z), _node(box, two, x, y, z)
        if b < a:
            one, two, a, b = two, one, b, a
        if b <= best:
            stack[top], near[top] = two, b
            top += 1
        if a <= best:
            stack[top], near[top] = one, a
            top += 1
    if found < 0:
        return np.inf, 0.0, 0.0, 0.0
    u, v, w = _normal(triangles, found, found_part)
    distance = math.sqrt(best)
    if not distance > 0.0:
        _, u, v, w = _round(u, v, w, 0.0)
        return 0.0, u, v, w
    if bx * u + by * v + bz * w < 0.0:
        distance = -distance
    return distance, bx / distance, by / distance, bz / distance


@compiled
def place_points(frame: Array, points: Array, placed: Array, box: Array) -> None:
    """Points (R, 3) in a frame that is a pose (7,) as points of the world, and the box (6,) around them."""
    x, y, z, w = frame[3], frame[4], frame[5], frame[6]
    turn = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    box[:3], box[3:] = np.inf, -np.inf
    for r in range(points.shape[0]):
        for k in range(3):
            a, b, c = turn[k]
            at = frame[k] + a * points[r, 0] + b * points[r, 1] + c * points[r, 2]
            placed[r, k] = at
            box[k], box[3 + k] = min(box[k], at), max(box[3 + k], at)


@compiled
def choose(posed: GeomPoses, e: int, seen: Array, box: Array, reach: float, candidates: Array) -> int:
    """The geoms of an env that are there, asked for and within reach of a box (6,); how many."""
    count = 0
    for g in range(seen.shape[0]):
        if seen[g] and posed.there[e, g]:
            apart = False
            for k in range(3):
                apart = apart or posed.low[e, g, k] > box[3 + k] + reach or posed.high[e, g, k] < box[k] - reach
            if not apart:
                candidates[count] = g
                count += 1
    return count


@compiled
def measure(
    geoms: Geoms,
    triangles: Triangles,
    posed: GeomPoses,
    seen: Array,
    frames: Array,
    points: Array,
    reach: float,
    distance: Array,
    number: Array,
    normal: Array,
) -> None:
    """The signed distance of each point from the geom that it is nearest to or deepest in, if that is within `reach`.

    Args:
        geoms, triangles, posed: the tables.
        seen: (G,) bool, the geoms that count.
        frames: (N, 7) poses of the frames that points are in.
        points: (N or 1, R, 3); one set of points may serve all envs.
        reach: the longest distance [m], or inf.
        distance: (N, R) written, inf where nothing is near.
        number: (N, R) int32 written, the World's index of the geom, -1.
        normal: (N, R, 3) written, unit, the direction in which the distance grows, world frame; zeros. With N = 0 rows
            none are written.
    """
    size = points.shape[1]
    placed, around = np.empty((size, 3)), np.empty(6)
    candidates = np.empty(seen.shape[0], dtype=np.int32)
    stack, near = np.empty(128, dtype=np.int32), np.empty(128)
    geom_stack, geom_near = np.empty(128, dtype=np.int32), np.empty(128)
    kinds, sizes, meshes = geoms.kind, geoms.size, geoms.mesh
    low, high, frame = posed.low, posed.high, posed.frame
    for e in range(frames.shape[0]):
        place_points(frames[e], points[e if points.shape[0] > 1 else 0], placed, around)
        count = choose(posed, e, seen, around, reach, candidates)
        tree = count > FEW and posed.box.shape[1] > 0
        for r in range(size):
            x, y, z = placed[r, 0], placed[r, 1], placed[r, 2]
            best, chosen = reach, -1
            bx, by, bz = 0.0, 0.0, 0.0
            i, top = 0, 0
            if tree:
                geom_stack[0], geom_near[0], top = 0, 0.0, 1
            while True:
                outside = best if best > 0.0 else 0.0
                if tree:
                    if top == 0:
                        break
                    top -= 1
                    if geom_near[top] > outside * outside:
                        continue
                    node = geom_stack[top]
                    leaf, to = posed.link[e, node, 0], posed.link[e, node, 1]
                    if leaf == 0:
                        one, two = node + 1, to
                        a, b = _node(posed.box[e], one, x, y, z), _node(posed.box[e], two, x, y, z)
                        if b < a:
                            one, two, a, b = two, one, b, a
                        geom_stack[top], geom_near[top] = two, b
                        geom_stack[top + 1], geom_near[top + 1] = one, a
                        top += 2
                        continue
                    g = posed.order[e, to]
                    if not seen[g]:
                        continue
                else:
                    if i == count:
                        break
                    g = candidates[i]
                    i += 1
                gap = _gap(
                    low[e, g, 0], low[e, g, 1], low[e, g, 2], high[e, g, 0], high[e, g, 1], high[e, g, 2], x, y, z
                )
                if gap > outside * outside:
                    continue
                a, b, c = x - frame[e, g, 9], y - frame[e, g, 10], z - frame[e, g, 11]
                u = frame[e, g, 0] * a + frame[e, g, 3] * b + frame[e, g, 6] * c
                v = frame[e, g, 1] * a + frame[e, g, 4] * b + frame[e, g, 7] * c
                w = frame[e, g, 2] * a + frame[e, g, 5] * b + frame[e, g, 8] * c
                if kinds[g] > CYLINDER:
                    limit = best if gap > 0.0 else np.inf  # outside of its box a mesh is not deeper than elsewhere
                    found, a, b, c = meshed(triangles, triangles.root[meshes[g]], u, v, w, limit, stack, near)
                else:
                    found, a, b, c = convex(kinds[g], sizes[g, 0], sizes[g, 1], sizes[g, 2], u, v, w)
                if found < best or (found == best and found < np.inf and (chosen < 0 or g < chosen)):
                    best, chosen, bx, by, bz = found, g, a, b, c
            distance[e, r] = best if chosen >= 0 else np.inf
            number[e, r] = geoms.number[chosen] if chosen >= 0 else -1
            if normal.shape[0] > 0:
                for k in range(3):
                    normal[e, r, k] = 0.0
                    if chosen >= 0:
                        normal[e, r, k] = (
                            frame[e, chosen, 3 * k] * bx
                            + frame[e, chosen, 3 * k + 1] * by
                            + frame[e, chosen, 3 * k + 2] * bz
                        )


@compiled
def fill(
    geoms: Geoms,
    triangles: Triangles,
    posed: GeomPoses,
    seen: Array,
    frames: Array,
    cell: float,
    low: float,
    high: float,
    solid: Array,
) -> None:
    """The cells of a grid in whose column, between two heights, something is less than half a cell from the middle.

    Args:
        geoms, triangles, posed, seen: as of `measure`.
        frames: (N, 7) upright poses of the middle of the grid, x along its columns.
        cell: [m] its width.
        low, high: [m] over the frames' origins.
        solid: (N, rows, columns) bool written, rows from the lowest y.
    """
    rows, columns = solid.shape[1], solid.shape[2]
    stack, near = np.empty(128, dtype=np.int32), np.empty(128)
    near_enough = cell / 2 - 1e-9  # a face that ends where a cell begins is not in it
    for e in range(frames.shape[0]):
        solid[e] = False
        z, w = frames[e, 5], frames[e, 6]
        cos, sin = w * w - z * z, 2 * z * w
        for g in range(seen.shape[0]):
            if not (seen[g] and posed.there[e, g]):
                continue
            bottom = max(low, posed.low[e, g, 2] - near_enough - frames[e, 2])
            top = min(high, posed.high[e, g, 2] + near_enough - frames[e, 2])
            if bottom > top:
                continue
            # the box around the geom's box in the grid, in cells
            x = (posed.low[e, g, 0] + posed.high[e, g, 0]) / 2 - frames[e, 0]
            y = (posed.low[e, g, 1] + posed.high[e, g, 1]) / 2 - frames[e, 1]
            u = (posed.high[e, g, 0] - posed.low[e, g, 0]) / 2
            v = (posed.high[e, g, 1] - posed.low[e, g, 1]) / 2
            a, b = cos * x + sin * y, cos * y - sin * x
            p = abs(cos) * u + abs(sin) * v + near_enough
            q = abs(sin) * u + abs(cos) * v + near_enough
            first = int(max(math.floor((a - p) / cell + columns / 2), 0.0))
            last = int(min(math.ceil((a + p) / cell + columns / 2), float(columns)))
            begin = int(max(math.floor((b - q) / cell + rows / 2), 0.0))
            end = int(min(math.ceil((b + q) / cell + rows / 2), float(rows)))
            frame, kind = posed.frame[e, g], geoms.kind[g]
            root = triangles.root[geoms.mesh[g]] if kind > CYLINDER else 0
            for i in range(begin, end):
                for j in range(first, last):
                    if solid[e, i, j]:
                        continue
                    a, b = (j + 0.5 - columns / 2) * cell, (i + 0.5 - rows / 2) * cell
                    x = frames[e, 0] + cos * a - sin * b - frame[9]
                    y = frames[e, 1] + sin * a + cos * b - frame[10]
                    height, outside = bottom, False
                    while height <= top:
                        z = frames[e, 2] + height - frame[11]
                        u = frame[0] * x + frame[3] * y + frame[6] * z
                        v = frame[1] * x + frame[4] * y + frame[7] * z
                        w = frame[2] * x + frame[5] * y + frame[8] * z
                        if kind > CYLINDER:
                            # once outside, it need not be known how far away what is far away is
                            gap = 0.0 if geoms.sheet[g] else math.sqrt(_node(triangles.box, root, u, v, w))
                            limit = 4 * cell if outside else np.inf
                            away = gap
                            if gap <= near_enough:
                                away, _, _, _ = meshed(triangles, root, u, v, w, limit, stack, near)
                                away = min(away, limit)
                            outside = True
                        else:
                            away, _, _, _ = convex(kind, geoms.size[g, 0], geoms.size[g, 1], geoms.size[g, 2], u, v, w)
                        if away <= near_enough:
                            solid[e, i, j] = True
                            break
                        height += away - near_enough + cell / 16  # nothing is nearer than that

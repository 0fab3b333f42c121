"""Compiled rays against posed geoms: the first surface that a ray crosses, from outside or from inside.

Shapes are met by formula and triangles one by one. A plane is met from above alone. Of geoms at the same distance the
first of the World counts, so that the order in which they are tried changes no bit. Numba's cache notices a change of a
kernel's own file only: what calls each other is in one file, but for what is never changed.

What is done for every ray and geom takes numbers and no arrays, which compilers hand on at no cost.
"""

import math

import numpy as np

from anysim.conventions import Array
from anysim_sensors.kernels.bounds import compiled, guarded
from anysim_sensors.tables import BOX, CAPSULE, CYLINDER, PLANE, SPHERE, GeomPoses, Geoms, Triangles

FEW = 96
"""Geoms up to which all boxes are tried, and what is in them from near to far; more are found by a tree."""
EDGE = 1e-12
"""How far beside a triangle, of its edges, a ray still meets it: none slips through between two."""
ALMOST = 1.0 + 1e-14


@guarded
def inverse(d: float) -> float:
    """What a number is divided by when it is multiplied by this; large, not endless, of nearly nothing."""
    return 1.0 / d if abs(d) > 1e-300 else 1e300


@compiled
def enter_box(box: Array, i: int, ox: float, oy: float, oz: float, ix: float, iy: float, iz: float) -> float:
    """Distance at which a ray of origin o and inverse direction i enters box i (6,); inf if it does not."""
    p, q = (box[i, 0] - ox) * ix, (box[i, 3] - ox) * ix
    enter, leave = (p, q) if p < q else (q, p)
    p, q = (box[i, 1] - oy) * iy, (box[i, 4] - oy) * iy
    low, high = (p, q) if p < q else (q, p)
    enter, leave = enter if enter > low else low, leave if leave < high else high
    p, q = (box[i, 2] - oz) * iz, (box[i, 5] - oz) * iz
    low, high = (p, q) if p < q else (q, p)
    enter, leave = enter if enter > low else low, leave if leave < high else high
    enter = enter if enter > 0.0 else 0.0
    return enter if enter <= leave * ALMOST else np.inf


@compiled
def _ball(x: float, y: float, z: float, dx: float, dy: float, dz: float, r: float) -> tuple[float, float]:
    """Where a line of unit direction is within r of the origin: from, to; reckoned from its nearest point on."""
    middle = -(x * dx + y * dy + z * dz)
    x, y, z = x + middle * dx, y + middle * dy, z + middle * dz
    inside = r * r - (x * x + y * y + z * z)
    if inside < 0.0:
        return np.inf, -np.inf
    half = math.sqrt(inside)
    return middle - half, middle + half


@guarded
def _tube(x: float, y: float, dx: float, dy: float, r: float) -> tuple[float, float]:
    """Where a line is within r of the z axis: from, to."""
    square = dx * dx + dy * dy
    if square < 1e-300:
        return (-np.inf, np.inf) if x * x + y * y <= r * r else (np.inf, -np.inf)
    middle = -(x * dx + y * dy) / square
    x, y = x + middle * dx, y + middle * dy
    inside = r * r - (x * x + y * y)
    if inside < 0.0:
        return np.inf, -np.inf
    half = math.sqrt(inside / square)
    return middle - half, middle + half


@guarded
def _slab(x: float, d: float, half: float) -> tuple[float, float]:
    """Where a line is between -half and half along an axis: from, to."""
    if d == 0.0:
        return (-np.inf, np.inf) if abs(x) <= half else (np.inf, -np.inf)
    inverse = 1.0 / d
    a, b = (-half - x) * inverse, (half - x) * inverse
    return (a, b) if a < b else (b, a)


@guarded
def cross_convex(
    kind: int, s0: float, s1: float, s2: float, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> float:
    """Distance at which a ray in its frame crosses the surface of a convex shape; inf if it does not."""
    if kind == PLANE:
        return -z / dz if dz < 0.0 and z >= 0.0 else np.inf
    if kind == SPHERE:
        enter, leave = _ball(x, y, z, dx, dy, dz, s0)
    elif kind == BOX:
        enter, leave = _slab(x, dx, s0)
        a, b = _slab(y, dy, s1)
        enter, leave = max(enter, a), min(leave, b)
        a, b = _slab(z, dz, s2)
        enter, leave = max(enter, a), min(leave, b)
    else:
        enter, leave = _tube(x, y, dx, dy, s0)
        a, b = _slab(z, dz, s1)
        enter, leave = max(enter, a), min(leave, b)
        if kind == CAPSULE:  # it is convex: all between the first and the last of its parts is inside
            if enter > leave:
                enter, leave = np.inf, -np.inf
            a, b = _ball(x, y, z - s1, dx, dy, dz, s0)
            enter, leave = min(enter, a), max(leave, b)
            a, b = _ball(x, y, z + s1, dx, dy, dz, s0)
            enter, leave = min(enter, a), max(leave, b)
    if enter > leave or leave < 0.0:
        return np.inf
    return enter if enter >= 0.0 else leave


@guarded
def _triangle(c: Array, i: int, x: float, y: float, z: float, dx: float, dy: float, dz: float) -> float:
    """Distance at which a ray meets triangle i, from either side; inf if it does not."""
    e0, e1, e2, f0, f1, f2 = c[i, 3], c[i, 4], c[i, 5], c[i, 6], c[i, 7], c[i, 8]
    px, py, pz = dy * f2 - dz * f1, dz * f0 - dx * f2, dx * f1 - dy * f0
    scale = e0 * px + e1 * py + e2 * pz
    if scale == 0.0:
        return np.inf
    scale = 1.0 / scale
    x, y, z = x - c[i, 0], y - c[i, 1], z - c[i, 2]
    u = (x * px + y * py + z * pz) * scale
    if u < -EDGE or u > 1.0 + EDGE:
        return np.inf
    qx, qy, qz = y * e2 - z * e1, z * e0 - x * e2, x * e1 - y * e0
    v = (dx * qx + dy * qy + dz * qz) * scale
    if v < -EDGE or u + v > 1.0 + EDGE:
        return np.inf
    t = (f0 * qx + f1 * qy + f2 * qz) * scale
    return t if t >= 0.0 else np.inf


@compiled
def cross_mesh(
    box: Array,
    link: Array,
    corner: Array,
    root: int,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    limit: float,
    stack: Array,
    near: Array,
) -> tuple[float, int]:
    """Distance to the first triangle that a ray in the mesh's frame meets within the limit, and which; inf, -1."""
    best, found = limit, -1
    ix, iy, iz = inverse(dx), inverse(dy), inverse(dz)
    enter = enter_box(box, root, x, y, z, ix, iy, iz)
    if enter > limit or enter == np.inf:
        return np.inf, -1
    node, top = root, 0
    while True:
        count, to = link[node, 0], link[node, 1]
        if count > 0:
            for i in range(to, to + count):
                t = _triangle(corner, i, x, y, z, dx, dy, dz)
                if t < best or (found < 0 and t <= best and t < np.inf):
                    best, found = t, i
            descend = False
        else:
            one, two = node + 1, to
            a, b = enter_box(box, one, x, y, z, ix, iy, iz), enter_box(box, two, x, y, z, ix, iy, iz)
            if b < a:
                one, two, a, b = two, one, b, a
            if b <= best and b < np.inf:
                stack[top], near[top] = two, b
                top += 1
            node = one
            descend = a <= best and a < np.inf
        while not descend:
            if top == 0:
                return (best, found) if found >= 0 else (np.inf, -1)
            top -= 1
            node = stack[top]
            descend = near[top] <= best


@compiled
def _outward(kind: int, s0: float, s1: float, s2: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """The outward normal of a shape at a point of its surface, both in its frame; of no particular length."""
    if kind == SPHERE:
        return x, y, z
    if kind == PLANE:
        return 0.0, 0.0, 1.0
    if kind == BOX:
        a, b, c = abs(x) - s0, abs(y) - s1, abs(z) - s2
        if a >= b and a >= c:
            return math.copysign(1.0, x), 0.0, 0.0
        if b >= c:
            return 0.0, math.copysign(1.0, y), 0.0
        return 0.0, 0.0, math.copysign(1.0, z)
    if kind == CYLINDER:
        if abs(z) - s1 > math.sqrt(x * x + y * y) - s0:
            return 0.0, 0.0, math.copysign(1.0, z)
        return x, y, 0.0
    return x, y, z - min(max(z, -s1), s1)


@compiled
def _flat(c: Array, i: int) -> tuple[float, float, float]:
    """The normal of triangle i, of no particular length."""
    e0, e1, e2, f0, f1, f2 = c[i, 3], c[i, 4], c[i, 5], c[i, 6], c[i, 7], c[i, 8]
    return e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0


@compiled
def turn_of(pose: Array) -> tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]:
    """The rotation matrix of a pose (7,), row by row."""
    x, y, z, w = pose[3], pose[4], pose[5], pose[6]
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


@compiled
def place_rays(frame: Array, origins: Array, directions: Array, rays: Array) -> None:
    """Rays (R, 9) of the world: origins and directions (R, 3) in a frame that is a pose (7,); directions made unit.

    The last three numbers are the inverse direction.
    """
    turn = turn_of(frame)
    for r in range(origins.shape[0]):
        ox, oy, oz = origins[r, 0], origins[r, 1], origins[r, 2]
        dx, dy, dz = directions[r, 0], directions[r, 1], directions[r, 2]
        scale = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = scale * dx, scale * dy, scale * dz
        for k in range(3):
            a, b, c = turn[k]
            rays[r, k] = frame[k] + a * ox + b * oy + c * oz
            d = a * dx + b * dy + c * dz
            rays[r, 3 + k], rays[r, 6 + k] = d, inverse(d)


@compiled
def _span(low: float, high: float, a: float) -> tuple[float, float]:
    return a if a < low else low, a if a > high else high


@compiled
def _swept(rays: Array, reach: float, start: Array, reached: Array) -> None:
    """The boxes (6,) around the origins of rays, and around all that they reach."""
    ax, ay, az, bx, by, bz = np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf
    cx, cy, cz, dx, dy, dz = np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf
    for r in range(rays.shape[0]):
        x, y, z = rays[r, 0], rays[r, 1], rays[r, 2]
        ax, bx = _span(ax, bx, x)
        ay, by = _span(ay, by, y)
        az, bz = _span(az, bz, z)
        cx, dx = _span(cx, dx, x + reach * rays[r, 3])
        cy, dy = _span(cy, dy, y + reach * rays[r, 4])
        cz, dz = _span(cz, dz, z + reach * rays[r, 5])
    start[0], start[1], start[2], start[3], start[4], start[5] = ax, ay, az, bx, by, bz
    reached[0], reached[1], reached[2] = min(ax, cx), min(ay, cy), min(az, cz)
    reached[3], reached[4], reached[5] = max(bx, dx), max(by, dy), max(bz, dz)


@compiled
def choose(posed: GeomPoses, e: int, seen: Array, rays: Array, reach: float, candidates: Array, away: Array) -> int:
    """The geoms of an env that are there, asked for and in reach, from near to far; how many.

    `away` is the least distance of each from the origin of any ray.
    """
    reached, start = np.empty(6), np.empty(6)
    endless = not reach < np.inf
    _swept(rays, 0.0 if endless else reach, start, reached)
    count = 0
    for g in range(seen.shape[0]):
        if not (seen[g] and posed.there[e, g]):
            continue
        apart, square = False, 0.0
        for k in range(3):
            a, b = posed.low[e, g, k], posed.high[e, g, k]
            apart = apart or (not endless and (a > reached[3 + k] or b < reached[k]))
            gap = max(a - start[3 + k], start[k] - b, 0.0)
            square += gap * gap
        if not apart:
            candidates[count], away[count] = g, math.sqrt(square)
            count += 1
    if count <= FEW:
        for i in range(1, count):
            g, distance, j = candidates[i], away[i], i
            while j > 0 and away[j - 1] > distance:
                candidates[j], away[j] = candidates[j - 1], away[j - 1]
                j -= 1
            candidates[j], away[j] = g, distance
    return count


@compiled
def gather(posed: GeomPoses, e: int, geoms: Geoms, candidates: Array, count: int, boxes: Array, shapes: Array) -> None:
    """Boxes (C, 6) and shapes (C, 15: frame and size) of the candidates next to each other."""
    for i in range(count):
        g = candidates[i]
        for k in range(3):
            boxes[i, k], boxes[i, 3 + k] = posed.low[e, g, k], posed.high[e, g, k]
            shapes[i, 12 + k] = geoms.size[g, k]
        for k in range(12):
            shapes[i, k] = posed.frame[e, g, k]


@compiled
def turned(f: Array, k: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector of the world in the axes of candidate k, whose rows of shapes are f."""
    return (
        f[k, 0] * x + f[k, 3] * y + f[k, 6] * z,
        f[k, 1] * x + f[k, 4] * y + f[k, 7] * z,
        f[k, 2] * x + f[k, 5] * y + f[k, 8] * z,
    )


@compiled
def write_normal(
    kind: int, corner: Array, triangle: int, f: Array, k: int, x: float, y: float, z: float, out: Array, r: int
) -> None:
    """The outward unit normal, world frame, of candidate k at a point of the world."""
    a, b, c = turned(f, k, x - f[k, 9], y - f[k, 10], z - f[k, 11])
    a, b, c = _outward(kind, f[k, 12], f[k, 13], f[k, 14], a, b, c) if triangle < 0 else _flat(corner, triangle)
    scale = 1.0
    if kind > BOX:  # of the others it is a unit vector
        length = math.sqrt(a * a + b * b + c * c)
        scale = 1.0 / length if length > 0.0 else 0.0
    for j in range(3):
        out[r, j] = (f[k, 3 * j] * a + f[k, 3 * j + 1] * b + f[k, 3 * j + 2] * c) * scale


@compiled
def cast(
    geoms: Geoms,
    triangles: Triangles,
    posed: GeomPoses,
    seen: Array,
    frames: Array,
    origins: Array,
    directions: Array,
    reach: float,
    distance: Array,
    number: Array,
    normal: Array,
) -> None:
    """The first geom that each ray meets within `reach` [m].

    Args:
        geoms, triangles, posed: the tables.
        seen: (G,) bool, the geoms that count.
        frames: (N, 7) poses of the frames that rays are in.
        origins, directions: (N or 1, R, 3); one set of rays may serve all envs.
        reach: the longest distance, or inf.
        distance: (N, R) written, inf where nothing is met.
        number: (N, R) int32 written, the World's index of the geom, -1.
        normal: (N, R, 3) zeros, written where something is met: outward, world frame. Of 0 rows none is.
    """
    most = seen.shape[0]
    rays = np.empty((origins.shape[1], 9))
    candidates, slot, away = np.empty(most, np.int32), np.empty(most, np.int32), np.empty(most)
    boxes, shapes, entry = np.empty((most, 6)), np.empty((most, 15)), np.empty(most)
    stack, near = np.empty(128, np.int32), np.empty(128)
    geom_stack, geom_near = np.empty(128, np.int32), np.empty(128)
    box, link, corner = triangles.box, triangles.link, triangles.corner
    for e in range(frames.shape[0]):
        p = e if origins.shape[0] > 1 else 0
        place_rays(frames[e], origins[p], directions[p], rays)
        count = choose(posed, e, seen, rays, reach, candidates, away)
        gather(posed, e, geoms, candidates, count, boxes, shapes)
        tree = count > FEW and posed.box.shape[1] > 0
        if tree:
            slot[:] = -1
            for i in range(count):
                slot[candidates[i]] = i
        for r in range(rays.shape[0]):
            ox, oy, oz, dx, dy, dz = rays[r, 0], rays[r, 1], rays[r, 2], rays[r, 3], rays[r, 4], rays[r, 5]
            ix, iy, iz = rays[r, 6], rays[r, 7], rays[r, 8]
            best, chosen, which = reach, -1, -1
            i, top = 0, 0
            if tree:
                geom_stack[0], geom_near[0], top = 0, 0.0, 1
            elif count == 1:  # as of taxels: it is met or not
                entry[0] = 0.0
            else:
                for j in range(count):
                    entry[j] = enter_box(boxes, j, ox, oy, oz, ix, iy, iz)
            while True:
                if tree:
                    if top == 0:
                        break
                    top -= 1
                    if geom_near[top] > best:
                        continue
                    node = geom_stack[top]
                    leaf, to = posed.link[e, node, 0], posed.link[e, node, 1]
                    if leaf == 0:
                        one, two = node + 1, to
                        a = enter_box(posed.box[e], one, ox, oy, oz, ix, iy, iz)
                        b = enter_box(posed.box[e], two, ox, oy, oz, ix, iy, iz)
                        if b < a:
                            one, two, a, b = two, one, b, a
                        if b <= best and b < np.inf:
                            geom_stack[top], geom_near[top] = two, b
                            top += 1
                        if a <= best and a < np.inf:
                            geom_stack[top], geom_near[top] = one, a
                            top += 1
                        continue
                    k = slot[posed.order[e, to]]
                    if k < 0:
                        continue
                else:
                    while i < count and away[i] <= best and (entry[i] > best or entry[i] == np.inf):
                        i += 1
                    if i == count or away[i] > best:
                        break
                    k = i
                    i += 1
                g = candidates[k]
                a, b, c = turned(shapes, k, ox - shapes[k, 9], oy - shapes[k, 10], oz - shapes[k, 11])
                u, v, w = turned(shapes, k, dx, dy, dz)
                triangle = -1
                if geoms.kind[g] > CYLINDER:
                    root = triangles.root[geoms.mesh[g]]
                    t, triangle = cross_mesh(box, link, corner, root, a, b, c, u, v, w, best, stack, near)
                else:
                    t = cross_convex(geoms.kind[g], shapes[k, 12], shapes[k, 13], shapes[k, 14], a, b, c, u, v, w)
                if t < best or (t == best and t < np.inf and (chosen < 0 or g < candidates[chosen])):
                    best, chosen, which = t, k, triangle
            distance[e, r] = best if chosen >= 0 else np.inf
            number[e, r] = geoms.number[candidates[chosen]] if chosen >= 0 else -1
            if normal.shape[0] > 0 and chosen >= 0:
                x, y, z = ox + best * dx, oy + best * dy, oz + best * dz
                write_normal(geoms.kind[candidates[chosen]], corner, which, shapes, chosen, x, y, z, normal[e], r)

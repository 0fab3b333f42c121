"""Polygons in the plane: cutting, measuring, comparing them, and drawing points from them.

A polygon is a tuple of corners (x, y) [m], counter-clockwise, in plain floats, as it has few corners; an area is a
tuple of convex polygons that do not overlap.
"""

from collections.abc import Callable, Sequence
from math import cos, hypot, pi, sin, sqrt

from anysim.conventions import Array

Point = tuple[float, float]
Polygon = tuple[Point, ...]
Area = tuple[Polygon, ...]

ROUND = 24
"""Corners of the polygon inside a circle that stands for it."""


def rectangle(low: Point, high: Point) -> Polygon:
    """The rectangle between two corners."""
    return (low, (high[0], low[1]), high, (low[0], high[1]))


def disc(center: Point, radius: float) -> Polygon:
    """A regular polygon inside of a circle."""
    turns = (2 * pi * k / ROUND for k in range(ROUND))
    return tuple((center[0] + radius * cos(t), center[1] + radius * sin(t)) for t in turns)


def size(polygon: Polygon) -> float:
    """Area [m^2]; positive where the corners run counter-clockwise."""
    return 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(polygon, (*polygon[1:], *polygon[:1]), strict=True))


def total(area: Area) -> float:
    """[m^2]."""
    return sum(size(polygon) for polygon in area)


def half_planes(polygon: Polygon) -> list[tuple[float, float, float]]:
    """Its edges as (nx, ny, d): the inside is where nx x + ny y <= d, the normal has length 1."""
    planes: list[tuple[float, float, float]] = []
    for a, b in zip(polygon, (*polygon[1:], *polygon[:1]), strict=True):
        dx, dy = b[0] - a[0], b[1] - a[1]
        length = hypot(dx, dy)
        if length > 1e-9:
            nx, ny = dy / length, -dx / length
            planes.append((nx, ny, nx * a[0] + ny * a[1]))
    return planes


def cut(polygon: Polygon, nx: float, ny: float, d: float) -> Polygon:
    """What of a polygon lies in nx x + ny y <= d; empty where nothing does."""
    out: list[Point] = []
    distance = [nx * x + ny * y - d for x, y in polygon]
    for k, here in enumerate(polygon):
        after = (k + 1) % len(polygon)
        a, b = distance[k], distance[after]
        if a <= 0:
            out.append(here)
        if (a < 0 < b) or (b < 0 < a):
            share = a / (a - b)
            out.append(
                (here[0] + share * (polygon[after][0] - here[0]), here[1] + share * (polygon[after][1] - here[1]))
            )
    return tuple(out) if len(out) >= 3 else ()


def within(polygon: Polygon, planes: Sequence[tuple[float, float, float]]) -> Polygon:
    """What of a polygon lies in all half planes."""
    for plane in planes:
        if not polygon:
            break
        polygon = cut(polygon, *plane)
    return polygon


def eroded(polygon: Polygon, reach: Callable[[float, float], float]) -> Polygon:
    """Where the origin of a thing that lies inside may be; `reach(nx, ny)` is how far it goes in a direction."""
    return within(polygon, [(nx, ny, d - reach(nx, ny)) for nx, ny, d in half_planes(polygon)])


def common(first: Area, second: Area) -> Area:
    """What lies in both."""
    cuts = [within(polygon, half_planes(other)) for polygon in first for other in second]
    return tuple(polygon for polygon in cuts if polygon)


def holds(area: Area, x: float, y: float, slack: float = 1e-9) -> bool:
    """Whether a point lies in it."""
    return any(all(nx * x + ny * y <= d + slack for nx, ny, d in half_planes(polygon)) for polygon in area)


def moved(area: Area, x: float, y: float, yaw: float) -> Area:
    """Turned about the origin, then shifted."""
    c, s = cos(yaw), sin(yaw)
    return tuple(tuple((x + c * px - s * py, y + s * px + c * py) for px, py in polygon) for polygon in area)


def bounds(area: Area) -> tuple[Point, Point]:
    """The lowest and the highest corner around it."""
    xs = [x for polygon in area for x, _ in polygon]
    ys = [y for polygon in area for _, y in polygon]
    return (min(xs), min(ys)), (max(xs), max(ys))


def center(area: Area) -> Point:
    """The centre of mass."""
    sx = sy = whole = 0.0
    for polygon in area:
        for a, b in zip(polygon, (*polygon[1:], *polygon[:1]), strict=True):
            weight = a[0] * b[1] - b[0] * a[1]
            sx, sy, whole = sx + weight * (a[0] + b[0]) / 3, sy + weight * (a[1] + b[1]) / 3, whole + weight
    if whole <= 0:
        return area[0][0]
    return sx / whole, sy / whole


def point_in(area: Area, u: float, v: float, w: float) -> Point:
    """The point of an area that three uniform numbers choose: uniformly distributed, by triangles."""
    triangles = [(p[0], p[k], p[k + 1]) for p in area for k in range(1, len(p) - 1)]
    sizes = [size(t) for t in triangles]
    wanted = u * sum(sizes)
    chosen = 0
    while chosen < len(sizes) - 1 and wanted > sizes[chosen]:
        wanted -= sizes[chosen]
        chosen += 1
    (ax, ay), (bx, by), (cx, cy) = triangles[chosen]
    root = sqrt(v)
    along = (1 - root, root * (1 - w), root * w)
    return along[0] * ax + along[1] * bx + along[2] * cx, along[0] * ay + along[1] * by + along[2] * cy


def convex_parts(corners: Sequence[Point]) -> Area:
    """A simple polygon, which may bend inwards, in triangles (by cutting off ears)."""
    ring = list(corners) if size(tuple(corners)) > 0 else list(reversed(corners))
    cut_off, left = ears(ring, 1e-9)
    parts = [tuple(ring[k] for k in part) for part in (*cut_off, left)]
    return tuple(part for part in parts if size(part) > 0)


def ears(ring: Sequence[Point], slack: float) -> tuple[list[tuple[int, int, int]], list[int]]:
    """Triangles of a simple counter-clockwise polygon by its corners' numbers, and the corners that are left.

    No other corner is nearer than `slack` [m] to the inside of a triangle.
    Three are left, or more where there is no further ear: what is left is no simple polygon, or has no area.
    """
    left = list(range(len(ring)))
    found: list[tuple[int, int, int]] = []
    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            ear = (ring[a], ring[b], ring[c])
            if side(*ear) > 1e-12 and not any(_within(ear, ring[i], slack) for i in left if ring[i] not in ear):
                found.append((a, b, c))
                del left[k]
                break
        else:
            break
    return found, left


def _within(ear: Polygon, point: Point, slack: float) -> bool:
    edges = zip(ear, (*ear[1:], ear[0]), strict=True)
    return all(side(a, b, point) >= -slack * hypot(b[0] - a[0], b[1] - a[1]) for a, b in edges)


def side(a: Point | Array, b: Point | Array, p: Point | Array) -> float:
    """Twice the area of a triangle: positive where p is to the left of the line from a to b."""
    return float((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]))


def hull(points: Sequence[Point]) -> Polygon:
    """The convex hull, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return tuple(ordered)

    def chain(run: Sequence[Point]) -> list[Point]:
        kept: list[Point] = []
        for p in run:
            while len(kept) > 1 and size((kept[-2], kept[-1], p)) <= 1e-15:
                kept.pop()
            kept.append(p)
        return kept

    lower, upper = chain(ordered), chain(ordered[::-1])
    return tuple(lower[:-1] + upper[:-1])

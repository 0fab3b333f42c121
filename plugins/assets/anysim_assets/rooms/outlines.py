"""Outlines: polygons as arrays (K, 2) [m], where many points are compared with them."""

import numpy as np

from anysim.conventions import Array
from anysim.geometry.polygon import Polygon, ears, side, size as size


def corners_of(polygon: Array) -> Polygon:
    """A polygon (K, 2) as a tuple of corners."""
    return tuple((float(x), float(y)) for x, y in polygon)


def oriented_rectangle(middle: Array, half: tuple[float, float], yaw: float) -> Array:
    """Corners (4, 2), counter-clockwise, of a rectangle of half sizes along its own axes."""
    x, y = half
    own = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    return middle + turned(own, yaw)


def turned(points: Array, yaw: float) -> Array:
    """Points (..., 2) turned about the origin."""
    c, s = np.cos(yaw), np.sin(yaw)
    return points @ np.array([[c, s], [-s, c]])


def overlap(a: Array, b: Array, gap: float = 0.0) -> bool:
    """Whether two convex polygons (or segments) come nearer than `gap` to each other along every edge's normal."""
    for first, second in ((a, b), (b, a)):
        edges = np.roll(first, -1, axis=0) - first
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=-1)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = normals[length[:, 0] > 1e-12] / length[length[:, 0] > 1e-12]
        one, two = first @ normals.T, second @ normals.T
        if ((one.max(axis=0) + gap <= two.min(axis=0)) | (two.max(axis=0) + gap <= one.min(axis=0))).any():
            return False
    return True


def distance(points: Array, polygon: Array) -> Array:
    """Distance (N,) [m] of points (N, 2) to a polygon's border; 0 inside of it."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    run = end - start
    to = points[:, None] - start
    share = np.clip((to * run).sum(-1) / np.maximum((run**2).sum(-1), 1e-300), 0.0, 1.0)
    away = np.linalg.norm(to - share[..., None] * run, axis=-1).min(axis=1)
    return np.where(inside(points, polygon), 0.0, away)


def inside(points: Array, polygon: Array) -> Array:
    """(N,) bool: which points (N, 2) are in a simple polygon."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    x, y = points[:, None, 0], points[:, None, 1]
    crosses = (a[:, 1] > y) != (b[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return (crosses & (x < at)).sum(axis=1) % 2 == 1


def encloses(polygon: Array, part: Array) -> bool:
    """Whether a simple polygon (K, 2) holds a convex one (L, 2)."""
    if not inside(part, polygon).all():
        return False
    ends = np.roll(polygon, -1, axis=0)
    return not any(overlap(np.stack([a, b]), part) for a, b in zip(polygon, ends, strict=True))


def crossing(polygon: Array) -> tuple[int, int] | None:
    """Two sides of a polygon that meet where they should not, by number."""
    n = len(polygon)
    for i in range(n):
        for j in range(i + 1, n):
            if j in ((i + 1) % n, (i - 1) % n):
                continue
            a, b, c, d = polygon[i], polygon[(i + 1) % n], polygon[j], polygon[(j + 1) % n]
            if side(a, b, c) * side(a, b, d) <= 0 and side(c, d, a) * side(c, d, b) <= 0:
                return i, j
    return None


def triangles(polygon: Array) -> Array:
    """(K - 2, 3) corners of the triangles of a simple counter-clockwise polygon (K, 2), one ear after the other.

    Raises:
        ValueError: the corners make no simple polygon.
    """
    found, left = ears(corners_of(polygon), 0.0)
    if len(left) > 3:
        raise ValueError("the corners make no simple polygon")
    return np.array([*found, left], dtype=np.int32)

"""Geometry of the floor plan: convex polygons as rows of corners (K, 2) [m], and simple polygons for rooms."""

import numpy as np

from anysim.conventions import Array


def rectangle(middle: Array, half: tuple[float, float], yaw: float) -> Array:
    """Corners (4, 2), counterclockwise, of a rectangle of half sizes along its own axes."""
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


def holds(polygon: Array, part: Array) -> bool:
    """Whether a simple polygon holds a convex one."""
    if not inside(part, polygon).all():
        return False
    ends = np.roll(polygon, -1, axis=0)
    return not any(overlap(np.stack([a, b]), part) for a, b in zip(polygon, ends, strict=True))


def area(polygon: Array) -> float:
    """Signed area [m^2], positive where the corners go counterclockwise."""
    x, y = polygon.T
    return float(0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def crossing(polygon: Array) -> tuple[int, int] | None:
    """Two sides of a polygon that meet where they should not, by number."""
    n = len(polygon)
    for i in range(n):
        for j in range(i + 1, n):
            if j in ((i + 1) % n, (i - 1) % n):
                continue
            a, b, c, d = polygon[i], polygon[(i + 1) % n], polygon[j], polygon[(j + 1) % n]
            if _side(a, b, c) * _side(a, b, d) <= 0 and _side(c, d, a) * _side(c, d, b) <= 0:
                return i, j
    return None


def _side(a: Array, b: Array, p: Array) -> float:
    return float((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]))


def triangles(polygon: Array) -> Array:
    """(K - 2, 3) corners of the triangles of a simple counterclockwise polygon, one ear after the other."""
    left = list(range(len(polygon)))
    found: list[tuple[int, int, int]] = []
    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            others = polygon[[i for i in left if i not in (a, b, c)]]
            ear = polygon[[a, b, c]]
            if _side(*ear) > 1e-12 and not _within(others, ear).any():
                found.append((a, b, c))
                left.pop(k)
                break
        else:
            raise ValueError("the corners make no simple polygon")
    return np.array([*found, tuple(left)], dtype=np.int32)


def _within(points: Array, ear: Array) -> Array:
    run = np.roll(ear, -1, axis=0) - ear
    to = points[:, None] - ear
    return np.all(run[:, 0] * to[..., 1] - run[:, 1] * to[..., 0] >= 0, axis=1)

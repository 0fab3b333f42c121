"""The area on which a robot with flat feet stands: corners of soles, their hull, and the nearest point inside it."""

import numpy as np

from anysim.conventions import Array


def convex_hull(points: Array) -> Array:
    """Corners (H, 2) of the convex hull of points (P, 2), counter-clockwise (Andrew's monotone chain)."""
    ordered = points[np.lexsort((points[:, 1], points[:, 0]))]
    chains = []
    for side in (ordered, ordered[::-1]):
        chain: list[Array] = []
        for point in side:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        chains.append(chain[:-1])
    return np.array(chains[0] + chains[1])


def nearest_inside(point: Array, corners: Array) -> Array:
    """The point (2,) itself where it lies in the polygon (H, 2; counter-clockwise), else the nearest on its border."""
    start = corners
    edge = np.roll(corners, -1, axis=0) - corners
    away = point - start
    if (edge[:, 0] * away[:, 1] - edge[:, 1] * away[:, 0] >= 0.0).all():
        return point.copy()
    along = (away * edge).sum(axis=1) / np.maximum((edge * edge).sum(axis=1), 1e-12)
    on_border = start + np.clip(along, 0.0, 1.0)[:, None] * edge
    distance = ((on_border - point) ** 2).sum(axis=1)
    return on_border[int(np.argmin(distance))]


def sole_corners(place: Array, sole: Array) -> Array:
    """Corners (4, 2) on the ground of a sole (x_min, x_max, y_min, y_max in the foot's frame) at (x, y, yaw)."""
    x = sole[[0, 1, 1, 0]]
    y = sole[[2, 2, 3, 3]]
    c, s = np.cos(place[2]), np.sin(place[2])
    return np.stack([place[0] + c * x - s * y, place[1] + s * x + c * y], axis=1)


def shrunken(sole: Array, margin: float) -> Array:
    """The sole without a rim of `margin` [m]; a rim never takes more than nine tenths of a side."""
    middle = np.array([sole[0] + sole[1], sole[0] + sole[1], sole[2] + sole[3], sole[2] + sole[3]]) / 2.0
    half = np.array([sole[1] - sole[0], sole[1] - sole[0], sole[3] - sole[2], sole[3] - sole[2]]) / 2.0
    return middle + np.array([-1.0, 1.0, -1.0, 1.0]) * np.maximum(half - margin, 0.1 * half)


def turned(place: Array, x: float, y: float, yaw: float) -> Array:
    """The place (x, y, yaw) that stands at (x, y, yaw) in the frame of another."""
    c, s = np.cos(place[2]), np.sin(place[2])
    return np.array([place[0] + c * x - s * y, place[1] + s * x + c * y, place[2] + yaw])


def _turn(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

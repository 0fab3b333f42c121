"""Triangles: of primitives, for renderers that need them; of the hull of points; and fewer that look the same."""

from math import pi

import numpy as np

from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.model.shapes import Box, Capsule, Cylinder, Shape, Sphere

ROUND = 16
"""Half the corners around a round shape, and the rings of a ball from pole to pole: within 0.5 % of its outline."""
FEW = 2_500
"""Faces that are affordable whatever they show: a software renderer draws ten such meshes in milliseconds."""
FAR = 5.0
"""No point of the surface is further off than this many times the error that nearly all of it keeps."""
NEARLY_ALL = 0.99
_SAMPLES, _NEIGHBOURS = 4_000, 24
_AGGRESSIVENESS = 2
"""Of quadric decimation. Its default of 7 removes thin parts whole: 28 mm of a robot's hip where this keeps 1 mm."""


def triangles(shape: Shape) -> tuple[Array, Array] | None:
    """Vertices (V, 3) [m] and faces (T, 3) of a primitive, counter-clockwise from outside; None for other shapes."""
    match shape:
        case Box(half):
            return box(np.array(half))
        case Sphere(r):
            bend = np.linspace(-pi / 2, pi / 2, ROUND)
            return turned(r * np.cos(bend), r * np.sin(bend))
        case Capsule(r, h):
            bend = np.linspace(0.0, pi / 2, ROUND // 2)
            across, up = r * np.cos(bend), h + r * np.sin(bend)
            return turned(np.concatenate([across[::-1], across]), np.concatenate([-up[::-1], up]))
        case Cylinder(r, h):
            return turned(np.array([0.0, r, r, 0.0]), np.array([-h, -h, h, h]))
        case _:
            return None


def box(half: Array) -> tuple[Array, Array]:
    """Vertices and triangles of a box of half edge lengths (3,)."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))])


def turned(across: Array, height: Array) -> tuple[Array, Array]:
    """Vertices and triangles of the body that a profile (K,), from below to above, makes turning about z [m]."""
    turn = np.arange(2 * ROUND) * (pi / ROUND)
    x, y = np.multiply.outer(across, np.cos(turn)), np.multiply.outer(across, np.sin(turn))
    vertices = np.stack([x, y, np.broadcast_to(height[:, None], x.shape)], axis=-1).reshape(-1, 3)
    ring, place = np.meshgrid(np.arange(len(across) - 1), np.arange(2 * ROUND), indexing="ij")
    a = (ring * 2 * ROUND + place).ravel()
    b = (ring * 2 * ROUND + (place + 1) % (2 * ROUND)).ravel()
    lower, upper = np.stack([a, b, b + 2 * ROUND], axis=1), np.stack([a, b + 2 * ROUND, a + 2 * ROUND], axis=1)
    return vertices, np.concatenate([lower, upper])


def enclosed_volume(vertices: Array, faces: Array) -> float:
    """[m^3] inside of the triangles (F, 3) of vertices (V, 3); NaN where they are not closed, so that it has none.

    Equal vertices are one. Each edge has as many triangles on its one side as on its other, turned the same way.
    """
    _, same = np.unique(np.asarray(vertices, dtype=float), axis=0, return_inverse=True)
    corners = same.reshape(-1)[np.asarray(faces)].astype(np.int64)
    there = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    edges = np.concatenate([corners[there][:, pair] for pair in ((0, 1), (1, 2), (2, 0))])
    count = len(vertices)
    forth, back = np.sort(edges[:, 0] * count + edges[:, 1]), np.sort(edges[:, 1] * count + edges[:, 0])
    if not len(edges) or not np.array_equal(forth, back):
        return float("nan")
    a, b, c = np.moveaxis((vertices - vertices.mean(axis=0))[np.asarray(faces)[there]], 1, 0)
    return abs(float((a * np.cross(b, c)).sum())) / 6


_FARTHEST = 1e100  # [m]; squares of what is beyond are not finite
_THINNEST = 1e-3  # [m] that a flat mesh is thickened to, along the direction in which it has no extent


def convex_hull(points: Array, budget: int) -> tuple[Array, Array]:
    """The convex hull of points (V, 3): vertices (K, 3) with K <= budget and outward faces (F, 3).

    A larger hull is approximated from inside: from its extreme points along the axes on, the vertex farthest outside of
    the present hull is added until the budget is used. Points in a plane are thickened to a millimetre.

    Raises:
        AssetError: fewer than three distinct points, or all in one line.
    """
    from scipy.spatial import ConvexHull, QhullError

    points = _with_volume(np.unique(np.asarray(points, dtype=float), axis=0))
    try:
        full = points[np.sort(ConvexHull(points).vertices)]
        if len(full) > budget:
            full = full[_greedy(full, budget)]
        hull = ConvexHull(full)
    except QhullError as error:
        raise AssetError(f"a collision mesh has no convex hull: {str(error).splitlines()[0]}") from error
    vertices = full[np.sort(hull.vertices)]
    number = {old: new for new, old in enumerate(np.sort(hull.vertices).tolist())}
    faces = np.array([[number[i] for i in row] for row in hull.simplices.tolist()], dtype=np.int32)
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    inward = (np.cross(b - a, c - a) * (a - vertices.mean(axis=0))).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return vertices, faces


def _with_volume(points: Array) -> Array:
    if not (np.abs(points) < _FARTHEST).all():
        raise AssetError("a collision mesh has points that are not finite, or too far off to have a hull")
    centred = points - points.mean(axis=0) if len(points) else points
    if len(points) < 3:
        raise AssetError(f"a collision mesh needs at least three distinct points, this one has {len(points)}")
    _, extent, axes = np.linalg.svd(centred, full_matrices=False)
    if extent[1] < 1e-9 * max(extent[0], 1e-9):
        raise AssetError("a collision mesh needs an area, the points of this one are all in one line")
    normal = axes[2] if len(axes) > 2 else np.cross(axes[0], axes[1])
    if len(points) > 3 and np.ptp(centred @ normal) > 1e-6 * extent[0] / np.sqrt(len(points)):
        return points
    return np.concatenate([points - normal * _THINNEST / 2, points + normal * _THINNEST / 2])


def _greedy(points: Array, budget: int) -> Array:
    """Indices of `budget` hull vertices that leave little of the hull outside of theirs."""
    from scipy.spatial import ConvexHull

    axes = np.concatenate([np.eye(3), -np.eye(3), [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]])
    chosen: list[int] = list(dict.fromkeys(np.argmax(points @ axes.T, axis=0).tolist()))
    while len(chosen) < budget:
        planes = ConvexHull(points[chosen]).equations  # (F, 4): outward normal, offset
        outside = (points @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        outside[chosen] = -np.inf
        farthest = int(np.argmax(outside))
        if outside[farthest] <= 0:
            break
        chosen.append(farthest)
    return np.array(sorted(chosen))


def decimated(vertices: Array, faces: Array, error: float, few: int = FEW) -> tuple[Array, Array]:
    """A surface (V, 3) [m], (F, 3), with equal vertices joined, as light as `error` [m] allows.

    The first of `few` faces, twice as many, … that keeps `NEARLY_ALL` of the surface's vertices within `error` and all
    of them within `FAR` times as much; the whole surface where none does, or where `error` is 0.
    """
    import fast_simplification
    import trimesh

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces(mesh.nondegenerate_faces())
    if len(mesh.faces) == 0:
        return vertices, faces
    mesh.remove_unreferenced_vertices()
    points, triangles = np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int32)
    count = few
    while error > 0 and count < len(triangles):
        light = fast_simplification.simplify(points, triangles, target_count=count, agg=_AGGRESSIVENESS)
        off = deviation(points, np.asarray(light[0], dtype=float)[np.asarray(light[1])])
        if np.quantile(off, NEARLY_ALL) <= error and off.max() <= FAR * error:
            used, renumbered = np.unique(light[1], return_inverse=True)
            return np.asarray(light[0], dtype=float)[used], renumbered.reshape(-1, 3).astype(np.int32)
        count = max(2 * count, len(light[1]) + 1)
    return points, triangles


def deviation(points: Array, triangles: Array) -> Array:
    """Distances [m] of evenly chosen ones of the points (V, 3) from a surface of triangles (F, 3, 3).

    Of each point the triangles with the nearest middles are looked at, so that a distance is never told too small.
    """
    from scipy.spatial import KDTree
    from trimesh.triangles import closest_point

    chosen = points[:: max(1, len(points) // _SAMPLES)]
    few = min(_NEIGHBOURS, len(triangles))
    _, near = KDTree(triangles.mean(axis=1)).query(chosen, k=few)
    nearest = closest_point(triangles[near.reshape(-1)], np.repeat(chosen, few, axis=0)).reshape(len(chosen), few, 3)
    return np.sqrt(((nearest - chosen[:, None]) ** 2).sum(axis=2)).min(axis=1)

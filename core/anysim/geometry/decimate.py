"""Lighter triangles that look like the heavy ones: as few as keep the surface within a stated distance."""

import numpy as np

from anysim.conventions import Array

FEW = 2_500
"""Faces that are affordable whatever they show: a software renderer draws ten such meshes in milliseconds."""
FAR = 5.0
"""No point of the surface is further off than this many times the error that nearly all of it keeps."""
NEARLY_ALL = 0.99
_SAMPLES, _NEIGHBOURS = 4_000, 24
_AGGRESSIVENESS = 2
"""Of quadric decimation. Its default of 7 removes thin parts whole: 28 mm of a robot's hip where this keeps 1 mm."""


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

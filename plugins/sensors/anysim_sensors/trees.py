"""Trees over triangles: made once for a mesh or a height field, whatever its name, and kept in the cache."""

import numpy as np

from anysim import cache
from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.model.world import HeightField

LEAF = 4
"""Triangles in a leaf."""
_VERSION = "anysim-tree-1"  # change with anything that changes the result


def mesh_tree(vertices: Array, faces: Array) -> dict[str, Array]:
    """Arrays of `anysim_sensors.tables.Triangles` for one mesh, but for `root`; vertices (V, 3) [m], faces (F, 3).

    Equal vertices are joined, so that triangles that touch know each other.
    """
    vertices = np.ascontiguousarray(vertices, dtype=float)
    faces = np.ascontiguousarray(faces, dtype=np.int64)
    key = cache.digest(_VERSION, str(LEAF), vertices.tobytes(), faces.tobytes())
    return cache.load_or_make("trees", key, lambda: _make(vertices, faces))


def field_triangles(field: HeightField) -> tuple[Array, Array]:
    """Vertices (V, 3) and faces (F, 3) of a height field, cut as `anysim.conventions` says, normals up."""
    heights = np.asarray(field.heights, dtype=float)
    rows, cols = heights.shape
    x = np.linspace(-field.size[0] / 2, field.size[0] / 2, cols)
    y = np.linspace(-field.size[1] / 2, field.size[1] / 2, rows)
    vertices = np.stack([*np.meshgrid(x, y), heights], axis=-1).reshape(-1, 3)
    number = np.arange(rows * cols).reshape(rows, cols)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    faces = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=2)
    return vertices, faces.reshape(-1, 3)


def _make(vertices: Array, faces: Array) -> dict[str, Array]:
    from anysim_sensors.kernels.bounds import build_tree

    joined, number = np.unique(vertices, axis=0, return_inverse=True)
    faces = number.reshape(-1)[faces]
    # a triangle with a corner twice is an edge of others
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    if not len(faces):
        raise AnysimError("a mesh without any triangle has no surface to meet; give it at least one")
    corners = joined[faces]
    count = len(faces)
    order = np.arange(count, dtype=np.int32)
    box, link = np.empty((2 * count, 6)), np.empty((2 * count, 2), dtype=np.int32)
    nodes = build_tree(corners.min(axis=1), corners.max(axis=1), LEAF, order, count, box, link)
    faces, corners = faces[order], corners[order]
    edges = np.concatenate([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=1)
    return {
        "box": box[:nodes],
        "link": link[:nodes],
        "corner": np.concatenate([corners[:, 0], edges], axis=1),
        "neighbour": _neighbours(faces),
        "vertex": faces.astype(np.int32),
        "normal": _vertex_normals(corners, faces, len(joined)),
    }


def _neighbours(faces: Array) -> Array:
    """(F, 3) int32: the triangle across each edge; -1 at a border, and where more than two meet."""
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    ends.sort(axis=1)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    first = np.append(True, (ends[order[1:]] != ends[order[:-1]]).any(axis=1))
    sizes = np.diff(np.append(np.flatnonzero(first), len(order)))
    begin = np.flatnonzero(first)[sizes == 2]
    one, two = order[begin], order[begin + 1]
    across = np.full(len(ends), -1, dtype=np.int32)
    across[one], across[two] = two // 3, one // 3
    return across.reshape(-1, 3)


def _vertex_normals(corners: Array, faces: Array, count: int) -> Array:
    """(V, 3) sums of the unit normals of the triangles at each vertex, times their angles there."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    sums = np.zeros((count, 3))
    for k in range(3):
        one, two = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        sine = np.linalg.norm(np.cross(one, two), axis=1)
        np.add.at(sums, faces[:, k], np.arctan2(sine, (one * two).sum(axis=1))[:, None] * normals)
    return sums

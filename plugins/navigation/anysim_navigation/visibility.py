"""Shortest ways by a visibility graph: slow and exact, what ways over meshes are held against."""

from typing import Any

import numpy as np

from anysim.conventions import Array

TOUCHING = 1e-7
"""[m] by which a line of sight may leave the free ground: along an edge it rounds to either side."""


class VisibilityGraph:
    """The corners of free ground that a taut way can bend at, and the lines between those that see each other."""

    def __init__(self, free: Any) -> None:
        """`free` are polygons of shapely."""
        import shapely

        self._free = free.buffer(TOUCHING)
        shapely.prepare(self._free)
        corners = [_inward(shapely.get_coordinates(ring)[:-1]) for ring in _rings(free)]
        self.corners = np.concatenate(corners) if corners else np.zeros((0, 2))
        first, second = np.triu_indices(len(self.corners), 1)
        seen = self._sees(self.corners[first], self.corners[second])
        self._edges = first[seen], second[seen]
        self._lengths = np.hypot(*(self.corners[first[seen]] - self.corners[second[seen]]).T)

    def length(self, start: Array, goal: Array) -> float:
        """[m] of the shortest way between two points; inf where there is none."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import dijkstra

        count = len(self.corners)
        points = np.concatenate([self.corners, start[None], goal[None]])
        ends = np.array(
            [[count, k] for k in range(count)] + [[count + 1, k] for k in range(count)] + [[count, count + 1]]
        )
        ends = ends[self._sees(points[ends[:, 0]], points[ends[:, 1]])]
        lengths = np.hypot(*(points[ends[:, 0]] - points[ends[:, 1]]).T)
        row, column = (np.concatenate([a, ends[:, k]]) for k, a in enumerate(self._edges))
        weight = np.concatenate([self._lengths, lengths])
        graph = coo_matrix((np.maximum(weight, 1e-12), (row, column)), shape=(count + 2, count + 2)).tocsr()
        return float(dijkstra(graph, directed=False, indices=count)[count + 1])

    def _sees(self, begin: Array, end: Array) -> Array:
        """(n,) bool: the lines between points (n, 2) stay on the free ground."""
        import shapely

        return shapely.covers(self._free, shapely.linestrings(np.stack([begin, end], axis=1)))


def _rings(free: Any) -> list[Any]:
    """The outer rings of polygons counter-clockwise and those of their holes clockwise: the ground is to the left."""
    import shapely

    polygons = [part.normalize() for part in shapely.get_parts(free)]
    turned = [shapely.orient_polygons(polygon) for polygon in polygons]
    return [ring for polygon in turned for ring in (polygon.exterior, *polygon.interiors)]


def _inward(ring: Array) -> Array:
    """The corners (K, 2) at which the ground bends around something."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return ring[before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] < 0]

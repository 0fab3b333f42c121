"""Navigation meshes: the ground where a disc can be, in triangles, and ways over it."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from anysim.conventions import Array
from anysim_navigation.agent import Agent, NoRoute

SLACK = 1e-6
"""[m] by which a point may be off the mesh and still counts as on it."""
TRIANGLE = 3


class NavMesh:
    """Where the middle of an agent may be, as triangles that share their edges.

    Attributes:
        agent: what it was made for.
        free: the polygons, of shapely.
        vertices: (V, 2) [m].
        triangles: (T, 3) numbers of vertices, counter-clockwise.
        neighbours: (T, 3) the triangle beyond the edge from corner k to k + 1, -1 where there is none.
        part: (T,) the connected part that each is in; there is a way between two points of one part, and of no others.
    """

    def __init__(self, free: Any, agent: Agent, heights: Callable[[Array], Array] | None = None) -> None:
        """`heights` says how high the ground is at points (K, 2); level where not given."""
        import shapely

        from anysim_navigation.kernels import search

        self.free, self.agent, self._heights, self._search = free, agent, heights, search
        parts = shapely.get_parts(shapely.constrained_delaunay_triangles(free))
        rings = shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3]  # closed
        self.vertices, numbers = np.unique(rings.reshape(-1, 2), axis=0, return_inverse=True)
        triangles = numbers.reshape(-1, 3).astype(np.int64)
        a, b, c = (self.vertices[triangles[:, k]] for k in range(3))
        area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        triangles[area < 0] = triangles[area < 0][:, ::-1]
        order = np.lexsort(triangles.T[::-1])  # the order of shapely is not promised
        self.triangles = np.ascontiguousarray(triangles[order])
        self.neighbours = _neighbours(self.triangles)
        self.part = search.parts(self.neighbours)

    @cached_property
    def area(self) -> float:
        """[m^2] of all of it."""
        return float(self.free.area)

    def is_navigable(self, point: ArrayLike) -> bool:
        """Whether the middle of the agent may be at a point (2,)."""
        return self._triangle(_point(point)) >= 0

    def snap(self, point: ArrayLike) -> Array:
        """The nearest point (2,) [m] where the middle of the agent may be: the same one if it may be there.

        Raises:
            NoRoute: it may be nowhere.
        """
        import shapely

        here = _point(point)
        if self.is_navigable(here):
            return here
        if not len(self.triangles):
            raise NoRoute(f"there is no room for a disc of radius {self.agent.radius:g} m anywhere")
        near = shapely.shortest_line(self.free, shapely.Point(here))
        return shapely.get_coordinates(near)[0].copy()

    def path(self, start: ArrayLike, goal: ArrayLike, *, snap: float = 0.0) -> Array:
        """The shortest way (K, 2) [m] through the triangles that A* finds, both ends among its points.

        Args:
            start, goal: (2,) [m]
            snap: [m] ends that are off the mesh by less are moved onto it.

        Raises:
            NoRoute: an end is off the mesh, or they lie in parts between which there is no way.
        """
        ends = [self._end(name, point, snap) for name, point in (("start", start), ("goal", goal))]
        first, last = (self._triangle(end) for end in ends)
        if self.part[first] != self.part[last]:
            raise NoRoute(
                f"no way from {_words(ends[0])} to {_words(ends[1])} for a disc of radius {self.agent.radius:g} m: "
                f"something closes it off (the start is in a part of {self._extent(first):.1f} m^2, the goal in one of "
                f"{self._extent(last):.1f} m^2)"
            )
        edges = self._search.corridor(self.vertices, self.triangles, self.neighbours, first, last, ends[0], ends[1])
        return self._search.taut(self.vertices, self.triangles, edges, ends[0], ends[1])

    def heights_at(self, points: Array) -> Array:
        """(K,) [m] of the ground under points (K, 2) of a way."""
        return np.zeros(len(points)) if self._heights is None else self._heights(points)

    def _end(self, name: str, point: ArrayLike, snap: float) -> Array:
        given = _point(point)
        near = self.snap(given)
        off = float(np.hypot(*(near - given)))
        if off > max(snap, SLACK):
            raise NoRoute(
                f"the {name} {_words(given)} is nowhere that a disc of radius {self.agent.radius:g} m fits; the "
                f"nearest place is {_words(near)}, {off:.2f} m off (allow that with `snap`)"
            )
        return near

    def _triangle(self, point: Array) -> int:
        return int(self._search.triangle_at(self.vertices, self.triangles, point[0], point[1], SLACK))

    def _extent(self, triangle: int) -> float:
        a, b, c = (self.vertices[self.triangles[self.part == self.part[triangle], k]] for k in range(3))
        cross = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        return 0.5 * float(cross.sum())


def length_of(path: Array) -> float:
    """[m] of a way (K, 2)."""
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def _neighbours(triangles: Array) -> Array:
    """(T, 3) the triangle that shares each edge, or -1."""
    begin, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    first, second = order[:-1][same], order[1:][same]
    found = np.full(triangles.size, -1, dtype=np.int64)
    found[first], found[second] = second // TRIANGLE, first // TRIANGLE
    return found.reshape(-1, TRIANGLE)


def _point(point: ArrayLike) -> Array:
    return np.array(point, dtype=float).ravel()[:2]


def _words(point: Array) -> str:
    return f"({point[0]:.2f}, {point[1]:.2f})"

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
NO_AREA = 1e-9
"""[m^2] smaller triangles have corners in a line, and which way they run is rounding."""


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
        triangles = _counter_clockwise(self.vertices, triangles)
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
        return float(_areas(self.vertices, self.triangles[self.part == self.part[triangle]]).sum())


def length_of(path: Array) -> float:
    """[m] of a way (K, 2)."""
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def _areas(vertices: Array, triangles: Array) -> Array:
    """(T,) [m^2], positive where the corners run counter-clockwise."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return 0.5 * ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))


def _counter_clockwise(vertices: Array, triangles: Array) -> Array:
    """The triangles, all turned the same way; one without an area as those beside it, which go along its edges back."""
    area = _areas(vertices, triangles)
    triangles = np.where(area[:, None] < 0, triangles[:, ::-1], triangles)
    beside, flat = _neighbours(triangles), set(np.flatnonzero(np.abs(area) < NO_AREA).tolist())
    while flat:
        turned = [t for t in flat if any(n >= 0 and n not in flat for n in beside[t])]
        if not turned:
            break
        for t in turned:
            flat.discard(t)
            k = next(k for k in range(TRIANGLE) if beside[t, k] >= 0 and beside[t, k] not in flat)
            a, b = triangles[t, k], triangles[t, (k + 1) % TRIANGLE]
            other = triangles[beside[t, k]]
            if any(other[e] == a and other[(e + 1) % TRIANGLE] == b for e in range(TRIANGLE)):
                triangles[t] = triangles[t, ::-1]
                beside[t] = beside[t, [1, 0, 2]]  # the edges of the corners (c, b, a)
    return triangles


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

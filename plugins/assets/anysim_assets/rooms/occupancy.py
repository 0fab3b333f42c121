"""Free space: a grid of what is covered, distances in it, points that keep a distance, and paths.

A cell counts as occupied as soon as anything in it could be: what the grid calls free is free.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.geometry.bounds import shape_bounds
from anysim.math import pose as P
from anysim.model.shapes import is_ground
from anysim.model.world import Box, Capsule, Cylinder, Mesh, MeshShape, Shape, Sphere, World
from anysim_assets.rooms import outlines as G

ROUND = 24
"""Corners of the polygon that stands for a disc, which lies inside of it."""


@dataclass(frozen=True)
class Occupancy:
    """A grid over the floor.

    `occupied` (rows, cols) bool, first row at the lowest y; `low` (2,) [m] is the corner of the first cell,
    `resolution` [m] the edge of a cell. What is outside of the area that was asked for counts as occupied.
    """

    occupied: Array
    low: Array
    resolution: float

    @classmethod
    def of_footprints(cls, footprints: Sequence[Array], area: Array, resolution: float) -> "Occupancy":
        """Of convex polygons (K, 2) [m] within a simple polygon (K, 2), outside of which nothing is free."""
        low, high = area.min(axis=0), area.max(axis=0)
        cols, rows = np.maximum(1, np.ceil((high - low) / resolution - 1e-9)).astype(int)
        x, y = (low[k] + (np.arange(n) + 0.5) * resolution for k, n in ((0, cols), (1, rows)))
        centres = np.stack(np.meshgrid(x, y), axis=-1)
        half = resolution * np.sqrt(0.5)
        flat_centres = centres.reshape(-1, 2)
        beyond = ~G.inside(flat_centres, area) | (_to_border(flat_centres, area) <= half)
        occupied = beyond.reshape(rows, cols)
        for polygon in footprints:
            first = np.floor((polygon.min(axis=0) - half - low) / resolution).astype(int)
            last = np.ceil((polygon.max(axis=0) + half - low) / resolution).astype(int)
            a, b = np.clip(first, 0, (cols, rows)), np.clip(last, 0, (cols, rows))
            window = (slice(a[1], b[1]), slice(a[0], b[0]))
            near = centres[window].reshape(-1, 2)
            if len(near):
                occupied[window] |= (G.distance(near, polygon) <= half).reshape(b[1] - a[1], b[0] - a[0])
        occupied.setflags(write=False)
        return cls(occupied, low, resolution)

    @property
    def centres(self) -> Array:
        """Middles (rows, cols, 2) [m] of the cells."""
        rows, cols = self.occupied.shape
        x, y = (self.low[k] + (np.arange(n) + 0.5) * self.resolution for k, n in ((0, cols), (1, rows)))
        return np.stack(np.meshgrid(x, y), axis=-1)

    @cached_property
    def clearance(self) -> Array:
        """(rows, cols) [m]: no point of a cell is nearer than this to anything that is occupied; 0 in occupied ones."""
        from scipy import ndimage

        padded = np.pad(~self.occupied, 1, constant_values=False)
        distance = np.asarray(ndimage.distance_transform_edt(padded))[1:-1, 1:-1] * self.resolution
        # between the middles of cells; both ends may be anywhere in theirs
        return np.maximum(0.0, distance - 2 * np.sqrt(0.5) * self.resolution)

    def free(self, radius: float) -> Array:
        """(rows, cols) bool: cells in all of whose points a disc of that radius [m] touches nothing."""
        return ~self.occupied & (self.clearance >= radius)

    def free_points(
        self, n: int, radius: float, rng: np.random.Generator, *, connected_to: Array | None = None
    ) -> Array:
        """Points (n, 2) [m], evenly over the places where a disc of `radius` [m] touches nothing.

        Args:
            rng: three numbers a point are drawn from it, so from a named stream the points are those of its episode.
            connected_to: only where such a disc can come to from this point (2,).

        Raises:
            AnysimError: there is no such place.
        """
        free = self.free(radius)
        if connected_to is not None:
            labels = self._parts(free)
            free = labels == self._label_at(labels, np.asarray(connected_to, dtype=float)) if free.any() else free
        rows, cols = np.nonzero(free)
        if len(rows) == 0:
            raise AnysimError(f"nowhere in the room is a free place of radius {radius:g} m; ask for a smaller one")
        u = rng.random((n, 3))
        cell = np.minimum((u[:, 0] * len(rows)).astype(int), len(rows) - 1)
        return self.low + (np.stack([cols[cell], rows[cell]], axis=-1) + u[:, 1:]) * self.resolution

    def connected(self, points: Array, radius: float) -> bool:
        """Whether a disc of `radius` [m] gets from each of the points (K, 2) to each other.

        A point counts as the free place nearest to it, if that is within `radius` + 0.3 m. It must lie in the largest
        part of the free space.
        """
        free = self.free(max(0.0, radius - self.resolution))
        if not free.any():
            return False
        labels = self._parts(free)
        sizes = np.bincount(labels[free])
        return all(self._label_at(labels, point, radius + 0.3) == int(sizes.argmax()) for point in points)

    @staticmethod
    def _parts(free: Array) -> Array:
        from scipy import ndimage

        found: Any = ndimage.label(free, structure=np.ones((3, 3)))
        return np.asarray(found[0])

    def _label_at(self, labels: Array, point: Array, reach: float = np.inf) -> int:
        """The part nearest to a point, -1 where none is within reach; the free cells have labels above 0."""
        rows, cols = np.nonzero(labels)
        at = self.low + (np.stack([cols, rows], axis=-1) + 0.5) * self.resolution
        away = np.linalg.norm(at - point, axis=1)
        nearest = int(away.argmin())
        return int(labels[rows[nearest], cols[nearest]]) if away[nearest] <= reach else -1


def _to_border(points: Array, polygon: Array) -> Array:
    """Distance (N,) of points (N, 2) to the border of a polygon, from both sides."""
    start = polygon
    run = np.roll(polygon, -1, axis=0) - start
    to = points[:, None] - start
    share = np.clip((to * run).sum(-1) / np.maximum((run**2).sum(-1), 1e-300), 0.0, 1.0)
    return np.linalg.norm(to - share[..., None] * run, axis=-1).min(axis=1)


def occupancy(
    world: World,
    area: Array,
    *,
    heights: tuple[float, float] = (0.02, 1.8),
    resolution: float = 0.05,
    body_pose: Array | None = None,
    without: Sequence[str] = (),
) -> Occupancy:
    """What covers the floor within `area` (K, 2) [m], from the neutral geometry.

    Args:
        heights: things that reach into this band [m] above height 0 count: a robot's from the floor to its head.
        resolution: edge of a cell [m].
        body_pose: (B, 7) of all bodies; where they are initially if not given.
        without: entities that do not count, such as the one that looks for a place.
    """
    poses = world.initial_body_pose if body_pose is None else body_pose
    ignored = {b for e in world.entities if e.name in without for b in range(e.body_start, e.body_stop)}
    return Occupancy.of_footprints(footprints(world, poses, heights, ignored), area, resolution)


def footprints(world: World, poses: Array, heights: tuple[float, float], ignored: set[int]) -> list[Array]:
    """Convex polygons (K, 2) that hold the outlines, from above, of the geoms that reach into a band of heights."""
    meshes = {mesh.name: mesh for mesh in world.meshes}
    found: list[Array] = []
    for geom in world.geoms:
        if not geom.collides or is_ground(geom.shape) or geom.body in ignored:
            continue
        local = P.pose(geom.position, geom.quaternion)
        pose = local if geom.body < 0 else P.compose(poses[geom.body], local)
        low, high = shape_bounds(geom.shape, pose, meshes)
        if high[2] <= heights[0] or low[2] >= heights[1]:
            continue
        found.append(_outline(geom.shape, pose, meshes))
    return found


def _outline(shape: Shape, pose: Array, meshes: Mapping[str, Mesh]) -> Array:
    """The convex polygon (K, 2) that holds the outline of a shape at a pose (7,), seen from above."""
    turn = 2 * np.pi * np.arange(ROUND) / ROUND
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=-1) / np.cos(np.pi / ROUND)
    match shape:
        case Sphere(radius):
            return pose[:2] + radius * ring
        case Capsule(radius, half):
            ends = pose[:3] + P.rotate(pose[3:], np.array([[0.0, 0.0, -half], [0.0, 0.0, half]]))
            return _hull((ends[:, None, :2] + radius * ring).reshape(-1, 2))
        case Cylinder(radius, half):
            corners = np.concatenate([np.column_stack([radius * ring, np.full(ROUND, z)]) for z in (-half, half)])
        case Box(half):
            corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(half)
        case MeshShape(name):
            corners = np.asarray(meshes[name].vertices)
        case _:
            raise TypeError(f"a {type(shape).__name__} has no outline")
    return _hull((pose[:3] + P.rotate(pose[3:], corners))[:, :2])


def _hull(points: Array) -> Array:
    """The convex hull (K, 2) of points (N, 2), counterclockwise (Andrew's monotone chain)."""
    order = points[np.lexsort((points[:, 1], points[:, 0]))]
    chains: list[list[Array]] = []
    for ordered in (order, order[::-1]):
        chain: list[Array] = []
        for p in ordered:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2], chain[-1]
                if (bx - ax) * (p[1] - ay) - (by - ay) * (p[0] - ax) > 1e-15:
                    break
                chain.pop()
            chain.append(p)
        chains.append(chain[:-1])
    return np.array([*chains[0], *chains[1]])

"""Scene geometry: the shapes of a World, asked with rays and points, wherever an engine says that bodies are.

It knows the neutral model and poses, and no engine: equal poses give equal readings. Envs are computed one after the
other, so that an env's bits do not depend on the others, or on how many threads share them.
"""

from collections.abc import Collection
from math import inf
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from anysim.conventions import IDENTITY_QUATERNION, Array
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.model.frames import FixedFrame
from anysim.model.world import World
from anysim.threads import shared
from anysim_sensors.compile import geom_tables
from anysim_sensors.tables import GeomPoses

TREE_FROM = 150
"""Geoms of a World from which on a tree over them is made for each env."""


class Hits(NamedTuple):
    """What rays (N, R) met first.

    Attributes:
        distance: (N, R) [m], inf where nothing is met.
        geom: (N, R) int32, index among the World's geoms, -1.
        normal: (N, R, 3) outward, world frame; zeros where nothing is met, no rows if it was not asked for. It points
            along the ray where the ray began inside of the geom, and met it on its way out.
    """

    distance: Array
    geom: Array
    normal: Array


class Distances(NamedTuple):
    """Distances of points (N, R) to the nearest surface.

    Attributes:
        distance: (N, R) [m], negative inside; inf where nothing is near. Outside of everything it is exact; in
            what overlaps it is the depth in the geom that the point is deepest in.
        geom: (N, R) int32, index among the World's geoms, -1.
        normal: (N, R, 3) the direction in which the distance grows, world frame; no rows if it was not asked for.
    """

    distance: Array
    geom: Array
    normal: Array


class SceneGeometry:
    """The geoms of a World that collide, or those that are visible, as tables for compiled kernels.

    A kernel is compiled by its first call, or read from numba's cache. It may be used from several threads; kernels run
    without the interpreter lock.

    Attributes:
        geoms: the tables, see `anysim_sensors.tables.Geoms`; one row a geom.
        triangles: of the meshes and height fields.
        all: (G,) bool, every geom.
    """

    def __init__(self, world: World, shapes: Literal["collision", "visual"] = "collision") -> None:
        from anysim_sensors.kernels import bounds, distances, rays

        self._pose_geoms, self._cast, self._measure = bounds.pose_geoms, rays.cast, distances.measure
        self.world = world
        self.geoms, self.triangles = geom_tables(world, shapes)
        self.all = np.ones(len(self.geoms.kind), dtype=bool)
        self.body = np.array([geom.body for geom in world.geoms] + [-1], dtype=np.int32)
        """(geoms + 1,) the body of each of the World's geoms; -1 for the world, and last for none."""
        self.row = np.full(len(world.geoms) + 1, -1, dtype=np.int32)
        """(geoms + 1,) the row of each of the World's geoms in the tables, -1 for those that are not in them."""
        self.row[self.geoms.number] = np.arange(len(self.all))
        entity = np.append(np.array(world.body_entity, dtype=np.int32), -1)
        self.segmentation = np.append(entity[self.body[:-1]] + 1, 0).astype(np.int32)
        """(geoms + 1,) the segmentation id of each of the World's geoms; 0 for the ground, and last for none."""

    def without(self, bodies: Collection[int]) -> Array:
        """(G,) bool: the geoms that are on none of these bodies, such as a sensor's own."""
        return ~np.isin(self.geoms.body, list(bodies))

    def on(self, bodies: Collection[int]) -> Array:
        """(G,) bool: the geoms that are on these bodies; -1 is the world."""
        return np.isin(self.geoms.body, list(bodies))

    def posed(self, body_pose: ArrayLike, presence: ArrayLike | None = None) -> GeomPoses:
        """Where all geoms are with bodies at poses (N, B, 7), as `State.body_pose`, for queries of one moment.

        `presence` (N, E) bool, as `Presence.entities`, says what is there; the nominal population if not given.
        """
        poses = np.array(body_pose, dtype=float, order="C")  # writable, as all are: kernels are compiled once
        bodies = len(self.world.bodies)
        if poses.ndim != 3 or poses.shape[1:] != (bodies, 7):
            raise AnysimError(
                f"the body poses of '{self.world.name}' have the shape (envs, {bodies}, 7), got {poses.shape}"
            )
        envs, count = len(poses), len(self.geoms.kind)
        there = self.world.initial_presence if presence is None else presence
        rows = np.empty((envs, len(self.world.entities)), dtype=bool)
        rows[:] = there
        nodes = 2 * count if count > TREE_FROM else 0
        posed = GeomPoses(
            np.empty((envs, count, 12)),
            np.empty((envs, count, 3)),
            np.empty((envs, count, 3)),
            np.empty((envs, count), dtype=bool),
            np.empty((envs, nodes, 6)),
            np.empty((envs, nodes, 2), dtype=np.int32),
            np.empty((envs, count), dtype=np.int32),
        )
        self._pose_geoms(self.geoms, poses, rows, posed)
        return posed

    def rays(
        self,
        posed: GeomPoses,
        frames: Array,
        origins: Array,
        directions: Array,
        *,
        reach: float = inf,
        seen: Array | None = None,
        normals: bool = False,
        threads: int = 1,
    ) -> Hits:
        """The first surface that each ray crosses, from outside or from inside; planes from above.

        Args:
            posed: where the geoms are.
            frames: (N, 7) poses of the frames that rays are in; `WORLD_FRAME` repeated for rays of the world.
            origins, directions: (R, 3) for all envs, or (N, R, 3) [m]; directions need no unit length.
            reach: [m] what is farther is not met.
            seen: (G,) bool, geoms that count; all if not given. See `without`.
            normals: whether normals are computed.
            threads: how many share the envs; the readings do not depend on it.
        """
        start, along = _sets(origins, len(frames)), _sets(directions, len(frames))
        if start.shape != along.shape:
            raise AnysimError(f"rays need as many origins as directions, got {start.shape} and {along.shape}")
        try:
            return Hits(*self._asked(self._cast, posed, frames, (start, along), seen, reach, normals, threads))
        except ZeroDivisionError:
            raise AnysimError("a ray needs a direction that is not zero") from None

    def distances(
        self,
        posed: GeomPoses,
        frames: Array,
        points: Array,
        *,
        reach: float = inf,
        seen: Array | None = None,
        normals: bool = False,
        threads: int = 1,
    ) -> Distances:
        """Signed distances of points (R, 3) or (N, R, 3) in frames (N, 7); arguments as of `rays`."""
        sets = (_sets(points, len(frames)),)
        return Distances(*self._asked(self._measure, posed, frames, sets, seen, reach, normals, threads))

    def _asked(
        self,
        kernel: Any,
        posed: GeomPoses,
        frames: Array,
        sets: tuple[Array, ...],
        seen: Array | None,
        reach: float,
        normals: bool,
        threads: int,
    ) -> tuple[Array, Array, Array]:
        envs, rows = len(frames), sets[0].shape[1]
        if envs != len(posed.there):
            raise AnysimError(f"{envs} frames for {len(posed.there)} envs; give one pose (7,) for each env")
        distance, number = np.empty((envs, rows)), np.empty((envs, rows), dtype=np.int32)
        normal = np.zeros((envs if normals else 0, rows, 3))
        frames = np.ascontiguousarray(frames, dtype=float)
        mask = self.all if seen is None else seen

        answers = (distance, number, normal)
        if threads <= 1 or envs < 2:  # a few microseconds count here
            kernel(self.geoms, self.triangles, posed, mask, frames, *sets, float(reach), *answers)
            return answers

        def block(part: slice) -> None:
            kernel(
                self.geoms,
                self.triangles,
                GeomPoses(*(array[part] for array in posed)),
                mask,
                frames[part],
                *(values if len(values) == 1 else values[part] for values in sets),
                float(reach),
                *(array[part] for array in answers),
            )

        size = -(-envs // threads)
        shared(block, [slice(i, i + size) for i in range(0, envs, size)], threads)
        return answers


WORLD_FRAME = P.pose((0.0, 0.0, 0.0), IDENTITY_QUATERNION)
"""(7,) the world's own frame as a pose."""


def mounted(body_pose: Array, mount: FixedFrame) -> Array:
    """Poses (N, 7) of a frame that is fixed to a body, with bodies at poses (N, B, 7)."""
    local = P.pose(mount.position, mount.quaternion)
    if mount.body < 0:
        return np.repeat(local[None], len(body_pose), axis=0)
    return P.compose(body_pose[:, mount.body], local)


def _sets(values: Array, envs: int) -> Array:
    """Rows (R, 3) of all envs or (N, R, 3) of each, as (1 or N, R, 3)."""
    rows = np.ascontiguousarray(values, dtype=float)
    rows = rows[None] if rows.ndim == 2 else rows
    if rows.ndim != 3 or rows.shape[2] != 3 or len(rows) not in (1, envs):
        raise AnysimError(f"rays and points have the shape (rays, 3) or ({envs}, rays, 3), got {np.shape(values)}")
    return rows

"""An independent check of paths: poses by the World's own kinematics, shape against shape, nothing of a planner."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import EngineError
from anysim.geometry.bounds import shape_bounds
from anysim.geometry.coal_solids import coal_hull, coal_solid, coal_triangles
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.pairs import may_meet
from anysim.model.shapes import Mesh, MeshShape, Plane, Shape
from anysim.model.world import World

STEP = 0.005
"""[rad] or [m] between the configurations that are looked at."""


def dense(path: Array, step: float = STEP) -> Array:
    """A path (T, K) with so many rows between its own that no joint moves by more than `step` from one to the next."""
    rows = [path[:1]]
    for a, b in pairwise(path):
        count = max(1, int(np.ceil(np.abs(b - a).max() / step)))
        rows.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(rows)


class _PlacedGeom(NamedTuple):
    """A geom in n poses: the corners (n, 3) of the box around it, its positions (n, 3) and turns (n, 3, 3)."""

    low: Array
    high: Array
    position: Array
    turn: Array


class Touching:
    """Which poses of all bodies of a World have shapes that touch; parts of one robot that touch at home may."""

    def __init__(self, world: World) -> None:
        """Raises EngineError for ground of triangles, which this check does not know."""
        self._geoms = [geom for geom in world.geoms if geom.collides]
        self._meshes = {mesh.name: mesh for mesh in world.meshes}
        self._shapes = [self._coal(geom.shape) for geom in self._geoms]
        self._boxes = [_box(geom.shape, self._meshes) for geom in self._geoms]
        self._local = [P.pose(geom.position, geom.quaternion) for geom in self._geoms]
        bodies = np.array([geom.body for geom in self._geoms])
        self._pairs = np.argwhere(np.triu(may_meet(world, bodies)))
        entity = np.append(np.array(world.body_entity, dtype=int), -1)[bodies]
        initial = np.array([[joint.initial for joint in world.joints]])
        home = self._placed(forward_kinematics(world, world.initial_body_pose[None], initial))
        own = entity[self._pairs[:, 0]] == entity[self._pairs[:, 1]]
        rests = [bool(same) and self._touch(*pair, home, 0) for same, pair in zip(own, self._pairs, strict=True)]
        self._pairs = self._pairs[~np.array(rests, dtype=bool)]

    def any(self, body_pose: Array) -> bool:
        """Whether anything touches in any of the poses (n, B, 7) of all bodies, that does not move in all of them."""
        placed = self._placed(body_pose)
        moves = np.array([any(np.ptp(rows, axis=0).any() for rows in (one.position, one.turn)) for one in placed])
        for a, b in self._pairs[moves[self._pairs].any(axis=1)]:
            near = ((placed[a].low <= placed[b].high) & (placed[b].low <= placed[a].high)).all(axis=1)
            if any(self._touch(a, b, placed, int(row)) for row in np.flatnonzero(near)):
                return True
        return False

    def _placed(self, body_pose: Array) -> list[_PlacedGeom]:
        still = np.tile(P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), (len(body_pose), 1))
        found = list[_PlacedGeom]()
        for geom, local, (middle, half) in zip(self._geoms, self._local, self._boxes, strict=True):
            pose = P.compose(still if geom.body < 0 else body_pose[:, geom.body], np.broadcast_to(local, still.shape))
            centre = pose[:, :3] + P.rotate(pose[:, 3:], np.broadcast_to(middle, (len(pose), 3)))
            turn = P.to_matrix(pose[:, 3:])
            reach = np.full_like(centre, np.inf) if half is None else np.abs(turn) @ half
            found.append(_PlacedGeom(centre - reach, centre + reach, pose[:, :3], turn))
        return found

    def _touch(self, a: int, b: int, placed: list[_PlacedGeom], row: int) -> bool:
        import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

        at = [coal.Transform3s(placed[g].turn[row], placed[g].position[row]) for g in (a, b)]
        result = coal.CollisionResult()
        coal.collide(self._shapes[a], at[0], self._shapes[b], at[1], coal.CollisionRequest(), result)
        return bool(result.isCollision())

    def _coal(self, shape: Shape) -> Any:
        import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

        if isinstance(shape, Plane):
            return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
        if isinstance(shape, MeshShape):
            mesh = self._meshes[shape.mesh]
            return coal_triangles(mesh.vertices, mesh.faces) if shape.concave else coal_hull(mesh.vertices)
        if (solid := coal_solid(shape)) is None:
            raise EngineError(f"paths over a {type(shape).__name__} cannot be checked; choose a task on a plane")
        return solid


def _box(shape: Shape, meshes: Mapping[str, Mesh]) -> tuple[Array, Array | None]:
    """Middle and half sizes (3,) of the box around a shape in its own frame; no sizes for a plane."""
    if isinstance(shape, Plane):
        return np.zeros(3), None
    low, high = shape_bounds(shape, P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), meshes)
    return (low + high) / 2, (high - low) / 2

"""Distances on the ground between a robot and bodies that move by themselves, such as the limbs of people."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import NameLookupError, listing, suggest
from anysim.geometry.bounds import shape_bounds
from anysim.math import pose as P
from anysim.model.shapes import is_ground
from anysim.model.world import Capsule, Geom, Mesh, Sphere, World
from anysim.task.scene import RobotView, SceneView

UPRIGHT = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
ALONG = (-1.0, 0.0, 1.0)
"""Places along a capsule, in halves of it, at which there is a disc of its radius."""


class Near(NamedTuple):
    """Discs of others around n robots, in the axes of their bases.

    Attributes:
        place: (n, D, 2) [m].
        velocity: (n, D, 2) over the ground [m/s], not relative to the robot.
        radius: (D,) [m].
    """

    place: Array
    velocity: Array
    radius: Array


class Separation:
    """The rectangle around a robot as it begins, and discs around the shapes of other entities, seen from above.

    Attributes:
        low, high: (2,) [m] corners of the rectangle, in the frame of the robot's root.
    """

    def __init__(self, scene: SceneView, robot: RobotView, others: Sequence[str]) -> None:
        """`others` are names of entities.

        Raises:
            NameLookupError: there is no such entity.
        """
        world = scene.engine.world
        low, high = scene.entity_shape(robot.name).bounds(UPRIGHT)
        self.low, self.high = low[:2], high[:2]
        self._scene, self._root = scene, world.entities[world.entity_numbers[robot.name]].root
        bodies, offsets, radii, numbers = list[int](), list[Array](), list[float](), list[int]()
        for name in others:
            if name not in world.entity_numbers:
                known = list(world.entity_numbers)
                raise NameLookupError(f"there is no entity '{name}'{suggest(name, known)} (entities: {listing(known)})")
            number = world.entity_numbers[name]
            entity = world.entities[number]
            for body in range(entity.body_start, entity.body_stop):
                for offset, radius in _discs(world, body):
                    bodies.append(body)
                    offsets.append(offset)
                    radii.append(radius)
                    numbers.append(number)
        self._bodies, self._numbers = np.array(bodies, dtype=np.int64), np.array(numbers, dtype=np.int64)
        self._offsets, self._radii = np.array(offsets).reshape(-1, 3), np.array(radii)

    @property
    def count(self) -> int:
        """How many discs there are."""
        return len(self._bodies)

    def places(self) -> tuple[Array, Array]:
        """(n, D, 2) [m] of the discs in the world and (n, D, 2) [m/s], for the rows at hand; absent ones far away."""
        state, rows, ids = self._scene.state, self._scene.rows, self._scene.env_ids
        pose, twist = state.body_pose[rows][:, self._bodies], state.body_twist[rows][:, self._bodies]
        arm = P.rotate(pose[..., 3:], np.broadcast_to(self._offsets, pose[..., :3].shape))
        place = (pose[..., :3] + arm)[..., :2]
        velocity = (twist[..., :3] + P.cross(twist[..., 3:], arm))[..., :2]
        return np.where(self._scene.presence[ids][:, self._numbers, None], place, np.inf), velocity

    def seen_from(self, place: Array, velocity: Array) -> Near:
        """The discs as they are seen from the robots at hand."""
        root = self._scene.state.body_pose[self._scene.rows, self._root]
        yaw = P.yaw(root[:, 3:])[:, None]
        c, s = np.cos(yaw), np.sin(yaw)
        off = place - root[:, None, :2]
        there, moves = (
            np.stack([c * v[..., 0] + s * v[..., 1], c * v[..., 1] - s * v[..., 0]], axis=-1) for v in (off, velocity)
        )
        return Near(there, moves, self._radii)

    def nearest(self) -> Array:
        """(n,) [m] between the robot's rectangle and the nearest disc, 0 where they overlap; inf without any."""
        if not self.count:
            return np.full(len(self._scene.env_ids), np.inf)
        place, velocity = self.places()
        near = self.seen_from(np.where(np.isfinite(place), place, 1e6), velocity)
        beside = np.maximum(np.maximum(self.low - near.place, near.place - self.high), 0.0)
        return np.maximum(P.norm(beside) - near.radius, 0.0).min(axis=1)


def _discs(world: World, body: int) -> list[tuple[Array, float]]:
    """Discs (offset (3,) in the body's frame, radius) over the shapes of a body that collide."""
    meshes = {mesh.name: mesh for mesh in world.meshes}
    found: list[tuple[Array, float]] = []
    for geom in (world.geoms[index] for index in world.body_geoms[body]):
        if geom.collides and not is_ground(geom.shape):
            found += _of_shape(geom, meshes)
    return found


def _of_shape(geom: Geom, meshes: dict[str, Mesh]) -> list[tuple[Array, float]]:
    middle, turn = np.array(geom.position, dtype=float), np.array(geom.quaternion, dtype=float)
    if isinstance(geom.shape, Sphere):
        return [(middle, float(geom.shape.radius))]
    if isinstance(geom.shape, Capsule):
        axis = P.rotate(turn, np.array([0.0, 0.0, float(geom.shape.half_length)]))
        return [(middle + share * axis, float(geom.shape.radius)) for share in ALONG]
    low, high = shape_bounds(geom.shape, UPRIGHT, meshes)
    return [(middle + P.rotate(turn, 0.5 * (low + high)), float(P.norm(0.5 * (high - low))))]

"""Movers: what goes through a room by itself, as discs with the velocities that they have."""

from collections.abc import Sequence
from math import inf

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError, listing, suggest
from anysim.math import pose as P
from anysim.model.world import BodyKind, Entity, EntityKind, JointType, World
from anysim.task.scene import SceneView
from anysim_navigation.robot_shape import outline_of

PARKED = 100.0
"""[m] how far off a mover is put that is not there."""
STANDS = 0.1
"""[m/s] a mover that is slower stands in the way as furniture does."""
PEOPLE = "avatar"
"""The family whose members walk."""
CREEPS, LEAST_SHARE, FASTEST = 0.01, 0.1, 0.6
"""[m/s] above which the velocity of who turns has the direction that it will keep, the least share of their pace that
they are taken to have meanwhile, and [m/s] the most that is foreseen of that."""
ASIDE, STRIDE = 0.08, 0.33
"""[m] to their sides and [s] of their way before and behind them, people take more room than as they stand: measured of
feet, at 0.2 to 0.5 m/s."""


def movers_of(world: World, robot: str, names: Sequence[str] | None = None) -> tuple[str, ...]:
    """The entities beside a robot that move by themselves: those named, or else all people and other robots.

    Raises:
        AnysimError: a name that there is not, or of something that cannot move.
    """
    others = [entity for entity in world.entities if entity.name != robot]
    if names is None:
        return tuple(e.name for e in others if _walks(e) and moving_body(world, e) is not None)
    for name in names:
        entity = next((e for e in others if e.name == name), None)
        if entity is None or moving_body(world, entity) is None:
            known = [e.name for e in others if moving_body(world, e) is not None]
            why = "is fixed to the world" if entity else f"is nothing beside '{robot}'{suggest(name, known)}"
            raise AnysimError(f"the mover '{name}' {why} (what moves: {listing(known)})")
    return tuple(dict.fromkeys(names))


def moving_body(world: World, entity: Entity) -> int | None:
    """The body that goes where the entity goes: its root, or what a rail of three joints carries; None if it stands."""
    if world.bodies[entity.root].kind is not BodyKind.STATIC:
        return entity.root
    over_ground = [world.joints[j] for j in range(entity.joint_start, min(entity.joint_start + 3, entity.joint_stop))]
    types = [joint.type for joint in over_ground]
    return over_ground[2].body if types == [JointType.PRISMATIC, JointType.PRISMATIC, JointType.REVOLUTE] else None


def _walks(entity: Entity) -> bool:
    return entity.kind is EntityKind.ROBOT or entity.family == PEOPLE


class Movers:
    """Entities that move by themselves. Their velocity is that which they have, not one that they were told.

    But people who turn as they set out walk at the squared cosine of what they have yet to turn, of their pace: this is
    what they are foreseen with.

    Attributes:
        names: theirs.
        bodies: all of theirs.
    """

    def __init__(self, scene: SceneView, names: Sequence[str], top: float = inf, *, strides: bool = True) -> None:
        """What of them is higher than `top` [m] above the ground takes no room; without `strides` each is one disc."""
        world = scene.engine.world
        self._scene = scene
        entities = [world.entities[world.entity_numbers[name]] for name in names]
        self._numbers = np.array([world.entity_numbers[name] for name in names], dtype=np.int64)
        self.names = tuple(names)
        moving = [moving_body(world, e) for e in entities]
        self._roots = np.array([e.root if m is None else m for e, m in zip(entities, moving, strict=True)], np.int64)
        self.bodies = {body for e in entities for body in range(e.body_start, e.body_stop)}
        low, high = np.zeros((2, len(entities), 2))
        for k, entity in enumerate(entities):
            outline = outline_of(world, entity.name, world.initial_body_pose[self._roots[k]], top)
            low[k], high[k] = outline.min(axis=0), outline.max(axis=0)
        people = self._people = np.array([entity.family == PEOPLE for entity in entities], dtype=bool)
        self._offset, radius = 0.5 * (low + high), 0.5 * (high - low).max(axis=1) + ASIDE * people
        each = np.arange(len(entities))
        pairs = each[people & strides]
        self._discs = np.concatenate([each, pairs])
        """(M,) the mover of each disc: people have one before them and one behind."""
        self._radius = radius[self._discs]
        self._stride = STRIDE * np.concatenate([people & strides, -np.ones(len(pairs))])

    def there(self, row: int, standing: bool) -> Array:
        """(E,) bool: the entities that a map is to have, in a row of the scene: of movers none, or those that stand."""
        env = int(self._scene.env_ids[row])
        present = self._scene.presence[env].copy()
        speed = np.hypot(*self._scene.state.body_twist[env, self._roots, :2].T)
        present[self._numbers[(speed > STANDS) | (not standing)]] = False
        return present

    def around(self, rows: Array, pose: Array) -> Array:
        """(n, M, 5) x, y, vx, vy and radius of discs in frames x, y, yaw (n, 3); `rows` are those of the scene."""
        if not len(self._roots):
            return np.zeros((len(rows), 0, 5))
        envs, state = self._scene.env_ids[rows], self._scene.state
        poses, speed = state.body_pose[envs][:, self._roots], state.body_twist[envs][:, self._roots, :2]
        place = poses[..., :2] + self._offset - pose[:, None, :2]
        place[~self._scene.presence[envs][:, self._numbers]] += PARKED
        speed = (speed * self._growth(speed, P.yaw(poses[..., 3:])))[:, self._discs]
        place = place[:, self._discs] + self._stride[:, None] * speed
        c, s = np.cos(pose[:, 2])[:, None], np.sin(pose[:, 2])[:, None]
        turned = [
            np.stack([c * v[..., 0] + s * v[..., 1], c * v[..., 1] - s * v[..., 0]], axis=-1) for v in (place, speed)
        ]
        radius = np.broadcast_to(self._radius, place.shape[:2])[..., None]
        return np.concatenate([*turned, radius], axis=-1)

    def _growth(self, speed: Array, yaw: Array) -> Array:
        """(n, R, 1) by how much velocities (n, R, 2) of who looks to `yaw` (n, R) are going to grow."""
        pace = np.hypot(speed[..., 0], speed[..., 1])
        along = (speed[..., 0] * np.cos(yaw) + speed[..., 1] * np.sin(yaw)) / np.maximum(pace, CREEPS)
        most = np.maximum(FASTEST / np.maximum(pace, CREEPS), 1.0)
        growth = np.minimum(1.0 / np.maximum(along**2, LEAST_SHARE), most)
        return np.where(self._people & (pace > CREEPS), growth, 1.0)[..., None]

"""Frames of logical objects: they follow what is there, which may be another entity, or nothing, in each env.

Which body that is, is looked up by env when the entities there have changed, at resets; a step only gathers.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from anysim.compile.variants import INSTANCER
from anysim.conventions import Array
from anysim.errors import NameLookupError, listing
from anysim.families.base import FamilyState
from anysim.math import pose as P
from anysim.model.frames import FixedFrame, frames_of
from anysim.model.slots import ABSENT, members
from anysim.model.world import ORIGIN, Slot, World

if TYPE_CHECKING:
    from anysim.task.scene import SceneView

_HERE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


class Column(NamedTuple):
    """One logical thing: for each entity that it can be the index of that entity and the frame on it."""

    name: str
    entities: tuple[int, ...]
    frames: tuple[FixedFrame, ...]


def columns_of(world: World, name: str) -> list[Column]:
    """What a name stands for, a column each: an object, all of a category, all bodies of an instancer.

    Raises:
        NameLookupError: nothing of the name exists, or something that it can be has no such frame.
    """
    found: list[Column] = []
    for slot, frames in frames_of(world, name):
        if "." not in name and world.entities[slot.entities[0]].family == INSTANCER:
            found += _instances(world, slot, frames)
        else:
            found.append(Column(slot.name, slot.entities, frames))
    return found


def _instances(world: World, slot: Slot, frames: tuple[FixedFrame, ...]) -> list[Column]:
    entities = [world.entities[e] for e in slot.entities]
    return [
        Column(
            f"{slot.name}.{i}",
            slot.entities,
            tuple(FixedFrame(e.body_start + i, ORIGIN, f.quaternion) for e, f in zip(entities, frames, strict=True)),
        )
        for i in range(entities[0].body_stop - entities[0].body_start)
    ]


def varies(world: World, slot: Slot) -> bool:
    """Whether a logical object is not the same in every env."""
    return any(set(slot.entities) & set(other.entities) for other in world.slots)


class Follower:
    """The frames of K logical things, each on the entity that is there; of what is absent, the world's own frame."""

    def __init__(self, scene: "SceneView", columns: Sequence[Column]) -> None:
        self.scene = scene
        self.names = tuple(column.name for column in columns)
        widest = max(len(column.entities) for column in columns)
        last = [[min(v, len(c.entities) - 1) for v in range(widest)] for c in columns]  # the last again, never chosen
        picked = [[(c.entities[v], c.frames[v]) for v in row] for c, row in zip(columns, last, strict=True)]
        self._entities = np.array([[entity for entity, _ in row] for row in picked])
        self._bodies = np.array([[frame.body for _, frame in row] for row in picked])
        self._locals = np.array([[[*f.position, *f.quaternion] for _, f in row] for row in picked])
        self._shifted = bool((self._locals != _HERE).any())
        self._present: Array = np.zeros((0, len(columns)), dtype=bool)  # (N, K), as the next two
        self._body = self._entity = np.zeros((0, len(columns)), dtype=int)
        self._local = np.zeros((0, len(columns), 7))
        self._population = -1

    def _meet(self) -> None:
        """Look up what is there in each env, where that may have changed."""
        if self._population == self.scene.population:
            return
        there = self.scene.presence[:, self._entities]  # (N, K, variants)
        which, k = there.argmax(axis=2), np.arange(len(self._entities))
        self._present = np.any(there, axis=2)
        self._body = np.where(self._present, self._bodies[k, which], ABSENT)
        self._entity = np.where(self._present, self._entities[k, which], ABSENT)
        self._local = self._locals[k, which]
        self._population = self.scene.population

    @property
    def present(self) -> Array:
        """(n, K) bool: which of them are there."""
        self._meet()
        return self._present[self.scene.rows]

    @property
    def bodies(self) -> Array:
        """(n, K) int: the body that each is fixed to, ABSENT where it is not there."""
        self._meet()
        return self._body[self.scene.rows]

    @property
    def entities(self) -> Array:
        """(n, K) int: the entity that each is, ABSENT where it is not there."""
        self._meet()
        return self._entity[self.scene.rows]

    @property
    def poses(self) -> Array:
        """(n, K, 7) in the world frame."""
        bodies = self.bodies
        poses = self.scene.state.body_pose[self.scene.env_ids[:, None], bodies]
        if self._shifted:
            poses = P.compose(poses, self._local[self.scene.rows])
        poses[bodies == ABSENT] = _HERE
        return poses

    @property
    def twists(self) -> Array:
        """(n, K, 6): velocities of the frames' origins [m/s] and rates [rad/s], world axes."""
        bodies = self.bodies
        at = (self.scene.env_ids[:, None], bodies)
        twists = self.scene.state.body_twist[at]
        if self._shifted:
            arm = self.poses[..., :3] - self.scene.state.body_pose[at][..., :3]
            twists[..., :3] += P.cross(twists[..., 3:], arm)
        twists[bodies == ABSENT] = 0.0
        return twists


class Points:
    """The points of a family's matter as a Follower has things; their axes are the world's."""

    def __init__(self, scene: "SceneView", state: Callable[[Array], FamilyState], name: str) -> None:
        self._state, self._scene = state, scene
        self.names = tuple(f"{name}.{i}" for i in range(self._now().points.shape[1]))

    def _now(self) -> FamilyState:
        return self._state(self._scene.env_ids)

    @property
    def present(self) -> Array:
        """(n, K) bool: which of them are there."""
        now = self._now()
        return np.asarray(now.fields.get("there", np.ones(now.points.shape[:2], dtype=bool)))

    @property
    def poses(self) -> Array:
        """(n, K, 7) in the world frame."""
        here = np.broadcast_to(_HERE, (len(self._scene.env_ids), len(self.names), 7))
        return np.concatenate([np.where(self.present[..., None], self._now().points, 0.0), here[..., 3:]], axis=-1)

    @property
    def twists(self) -> Array:
        """(n, K, 6) [m/s]: velocities, and no rates."""
        moving = np.where(self.present[..., None], self._now().velocities, 0.0)
        return np.concatenate([moving, np.zeros_like(moving)], axis=-1)


class CategoryView:
    """All instances of a category or an instancer, or all particles of a family; K is the same in every env.

    In YAML: its name.
    """

    reference_kind = "category"

    def __init__(self, scene: "SceneView", name: str) -> None:
        world = scene.engine.world
        self._moment, self._poses, self._scene, self.name = -1, np.zeros((0, 0, 7)), scene, name
        if scene.families is not None and (points := scene.families.points(name)) is not None:
            self._follower: Follower | Points = Points(scene, points, name)
            return
        if not members(world, name.partition(".")[0]):
            known = list(world.categories)
            raise NameLookupError(f"there is no category '{name}' (categories: {listing(known)})")
        self._follower = Follower(scene, columns_of(world, name))

    def __len__(self) -> int:
        """The number of instances K."""
        return len(self.names)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the instances, in order."""
        return self._follower.names

    @property
    def poses(self) -> Array:
        """(n, K, 7) in the world frame; of what is absent the world's own frame."""
        if self._moment != self._scene.moment:
            self._poses, self._moment = self._follower.poses, self._scene.moment
        return self._poses

    @property
    def positions(self) -> Array:
        """(n, K, 3) [m]; of what is absent zero."""
        return self.poses[..., :3]

    @property
    def twists(self) -> Array:
        """(n, K, 6) [m/s, rad/s], world axes; of what is absent zero."""
        return self._follower.twists

    @property
    def present(self) -> Array:
        """(n, K) bool: which of them are there."""
        return self._follower.present

"""The recipe that all envs of a world are built from: everything about the World that is worked out once."""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.engine.presence import bodies_there
from anysim.errors import EngineError
from anysim.kinematics.inertia import Principal, check_physical, principal
from anysim.math import pose as P
from anysim.model.shapes import is_ground
from anysim.model.world import BodyKind, Joint, World
from anysim_mechanics.collision_groups import Copy
from anysim_mechanics.layout import Layout
from anysim_mechanics.meeting import Meeting
from anysim_mechanics.mimic_tendons import tendon_of
from anysim_sapien.large_ground import ground_files
from anysim_sapien.options import SapienOptions
from anysim_sapien.packing import Packing
from anysim_sapien.shapes import to_pose

_KEPT = 64
"""Of what follows from values that may be drawn in each reset, this is kept beside what the envs have now."""


class Values(NamedTuple):
    """The parameters of one env that its scene is built with."""

    mass: Array
    com: Array
    inertia: Array
    damping: Array
    geom_friction: Array
    geom_restitution: Array
    joint_friction: Array
    armature: Array
    gravity: Array


class Recipes:
    """What all envs of a world are built from: one recipe for each set of entities that are there."""

    def __init__(self, world: World, options: SapienOptions, num_envs: int = 1) -> None:
        self.world, self.options = world, options
        self.layout = Layout.of(world)
        """That of everything that may be there."""
        self.root_pose = [to_pose(np.array([*b.position, *b.quaternion])) for b in world.bodies]
        self.frames = [_joint_frames(world, joint) for joint in world.joints]
        self.initial = np.array([joint.initial for joint in world.joints])
        # drawn values never come again: kept are those that all resets share, and the present ones of each env
        self._principal = lru_cache(maxsize=_KEPT + num_envs * len(world.bodies))(self._make_principal)
        self._made = lru_cache(maxsize=_KEPT)(self._make)
        self.copies = lru_cache(maxsize=_KEPT + num_envs)(_copies)
        """Shapes for (a `Meeting`, friction, restitution), the latter two as bytes."""
        self.ground_files = ground_files(world)
        _check(world)

    def of(self, present: Array) -> "Recipe":
        """The recipe for the entities (E,) that are there."""
        return self._made(present.tobytes())

    def _make(self, present: bytes) -> "Recipe":
        return Recipe(self, np.frombuffer(present, dtype=bool))

    def principal(self, body: int, inertia: Array) -> Principal:
        """The principal moments of a body, computed once."""
        return self._principal(body, np.asarray(inertia, dtype=float).tobytes())

    def _make_principal(self, body: int, inertia: bytes) -> Principal:
        found = principal(np.frombuffer(inertia))
        check_physical(self.world.bodies[body].name, found.moments)
        return found


class Recipe:
    """What an env is built from, with some of the World's entities: indices are the World's."""

    def __init__(self, common: Recipes, present: Array) -> None:
        self.world, self.options, self.common = common.world, common.options, common
        self.present = present
        """(E,) bool, the entities that are there."""
        self.layout = Layout.of(common.world, bodies_there(common.world, present))
        self.meeting = Meeting(self.world, self.layout)
        """What touches what, and with which coefficients."""
        self.groups = self.meeting.apart.groups
        self.geoms_on: dict[int, list[int]] = {}
        for i in self.meeting.solid.tolist():
            self.geoms_on.setdefault(self.world.geoms[i].body, []).append(i)
        self.packing: Packing | None = None
        """Where things are in the packed state of its scenes; that of the first one is looked at."""

    def copies(self, friction: Array, restitution: Array) -> dict[int, list[Copy]]:
        """The shapes of each geom that collides, for the coefficients in force (G,)."""
        return self.common.copies(self.meeting, friction.tobytes(), restitution.tobytes())


def _copies(meeting: Meeting, friction: bytes, restitution: bytes) -> dict[int, list[Copy]]:
    return meeting.copies(np.frombuffer(friction), np.frombuffer(restitution))


def _joint_frames(world: World, joint: Joint) -> tuple[Any, Any]:
    """The joint's frame in the parent's and in the child's: PhysX' axis is x."""
    axis = np.asarray(joint.axis, dtype=float)
    in_child = np.concatenate([joint.anchor, _turn_x_to(axis)])
    body = world.bodies[joint.body]
    in_parent = P.compose(np.array([*body.position, *body.quaternion]), in_child)
    return to_pose(in_parent), to_pose(in_child)


def _turn_x_to(axis: Array) -> Array:
    """The shortest turn (4,) of the x axis to `axis`."""
    if axis[0] < -1 + 1e-12:
        return np.array([0.0, 0.0, 1.0, 0.0])
    half = np.array([0.0, -axis[2], axis[1], 1.0 + axis[0]])
    return P.normalize(half)


def _check(world: World) -> None:
    for body in world.bodies:
        if body.kind is not BodyKind.STATIC and body.inertial.mass <= 0:
            raise EngineError(f"body '{body.name}' moves and has no mass; give it one, or join it to its parent")
    for index, joint in enumerate(world.joints):
        if joint.mimic is not None:
            tendon_of(world, index)
    for geom in world.geoms:
        loose = geom.body != WORLD and world.bodies[geom.body].kind is not BodyKind.STATIC
        if loose and geom.collides and is_ground(geom.shape):
            raise EngineError(
                f"geom '{geom.name}' is a {type(geom.shape).__name__} on a body that moves; PhysX collides these with "
                f"fixed bodies alone"
            )

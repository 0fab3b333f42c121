"""What all envs of a world are built from: everything about the World that is worked out once."""

from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.errors import EngineError
from anysim.math import pose as P
from anysim.world.model import BodyKind, HeightFieldShape, Joint, Plane, World
from anysim_sapien.inertia import Principal, principal
from anysim_sapien.layout import Layout
from anysim_sapien.meeting import Meeting
from anysim_sapien.options import SapienOptions
from anysim_sapien.shapes import to_pose
from anysim_sapien.surfaces import Copy


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


class Recipe:
    """What all envs of a world are built from."""

    def __init__(self, world: World, options: SapienOptions) -> None:
        self.world, self.options, self.layout = world, options, Layout.of(world)
        self._meeting = Meeting(world, self.layout)
        self.groups = self._meeting.apart.groups
        self.geoms_on: dict[int, list[int]] = {}
        for i in self._meeting.solid.tolist():
            self.geoms_on.setdefault(world.geoms[i].body, []).append(i)
        self.root_pose = [to_pose(np.array([*b.position, *b.quaternion])) for b in world.bodies]
        self.frames = [_joint_frames(world, joint) for joint in world.joints]
        self.initial = np.array([joint.initial for joint in world.joints])
        self._principal: dict[tuple[str, bytes], Principal] = {}
        self._copies: dict[bytes, dict[int, list[Copy]]] = {}
        _check(world)

    def copies(self, friction: Array, restitution: Array) -> dict[int, list[Copy]]:
        """The shapes of each geom that collides, for the coefficients in force (G,)."""
        key = friction.tobytes() + restitution.tobytes()
        if key not in self._copies:
            if len(self._copies) > 1000:
                self._copies.clear()
            self._copies[key] = self._meeting.copies(friction, restitution)
        return self._copies[key]

    def principal(self, body: int, inertia: Array) -> Principal:
        """The principal moments of a body, computed once."""
        key = (self.world.bodies[body].name, inertia.tobytes())
        if key not in self._principal:
            if len(self._principal) > 10000:
                self._principal.clear()
            self._principal[key] = principal(key[0], inertia)
        return self._principal[key]


def tendon_chain(world: World, follower: int) -> tuple[list[int], list[float]]:
    """The links of a fixed tendon, and their coefficients, that hold `follower - multiplier * leader` at the offset.

    Raises:
        EngineError: the two joints do not move links that are neighbours or have one parent.
    """
    joint = world.joints[follower]
    assert joint.mimic is not None
    leader = world.joints[joint.mimic.joint]
    child, guide = joint.body, leader.body
    parent = world.bodies[child].parent
    if parent == world.bodies[guide].parent:
        return [parent, guide, child], [0.0, -joint.mimic.multiplier, 1.0]
    if parent == guide:
        return [world.bodies[guide].parent, guide, child], [0.0, -joint.mimic.multiplier, 1.0]
    raise EngineError(
        f"SAPIEN cannot make joint '{joint.name}' follow '{leader.name}': a tendon joins links with one parent, or a "
        f"link and its child; drive the joint itself, or use another engine"
    )


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
            tendon_chain(world, index)
    for geom in world.geoms:
        loose = geom.body != WORLD and world.bodies[geom.body].kind is not BodyKind.STATIC
        if loose and geom.collides and isinstance(geom.shape, HeightFieldShape | Plane):
            raise EngineError(
                f"geom '{geom.name}' is a {type(geom.shape).__name__} on a body that moves; PhysX collides these with "
                f"fixed bodies alone"
            )

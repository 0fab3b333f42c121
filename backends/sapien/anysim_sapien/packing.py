"""The layout of a scene's packed state: two calls of SAPIEN give all that is read of it after a step.

SAPIEN documents neither order; a scene of each kind is compared with its getters when it is built.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import EngineError
from anysim.model.world import BodyKind, World
from anysim_mechanics.layout import Layout

_CONSTANTS = np.array([0.0, 1.0], dtype=np.float32).tobytes()
"""In front of what is packed: what is not there has these for its numbers."""

_ZERO, _ONE = 0, 1
_POSE = np.array([4, 5, 6, 1, 2, 3, 0])
"""Columns of SAPIEN's packed poses, which are a quaternion wxyz and then the position, in our order."""
_NOWHERE = [_ZERO] * 6 + [_ONE]
_ROOT = 13
"""Numbers of an actor, and of an articulation before its joints': pose, linear and angular velocity."""
_PER_JOINT = 4
"""Position, velocity, and two targets."""


def pack(system: Any, scene: Any) -> bytes:
    """The state of a scene now, as float32."""
    return _CONSTANTS + system.pack() + scene.pack_poses()


@dataclass(frozen=True, eq=False)
class Packing:
    """Places of numbers in the packed state of scenes in which the same things are there.

    Velocities are those of free bodies, of their centres of mass; those of other bodies are 0.
    """

    size: int
    joint_pos: Array
    """(J,)"""
    joint_vel: Array
    """(J,)"""
    velocity: Array
    """(B, 6) linear and angular."""
    pose: Array
    """(B, 7) xyzw."""

    @classmethod
    def of(cls, world: World, layout: Layout, scene: Any) -> "Packing":
        """That of an `EnvScene`, by the order of what is in it.

        Raises:
            EngineError: SAPIEN packs something else.
        """
        bodies = len(world.bodies)
        pos, vel = np.full(len(world.joints), _ZERO), np.full(len(world.joints), _ZERO)
        velocity, pose = np.full((bodies, 6), _ZERO), np.tile(_NOWHERE, (bodies, 1))
        at = len(_CONSTANTS) // 4
        for component in scene.system.rigid_dynamic_components:
            velocity[scene.body_of[component]] = np.arange(at + 7, at + _ROOT)
            at += _ROOT
        links = scene.system.articulation_link_components
        for number in dict.fromkeys(int(layout.tree_of[scene.body_of[link]]) for link in links):
            tree = scene.trees[number]
            if world.bodies[tree.bodies[0]].kind is BodyKind.FREE:
                velocity[tree.bodies[0]] = np.arange(at + 7, at + _ROOT)
            places = at + _ROOT + np.arange(len(tree.joints))
            pos[tree.joints], vel[tree.joints] = places, places + len(tree.joints)
            at += _ROOT + _PER_JOINT * len(tree.joints)
        body_of = {entity: body for body, entity in enumerate(scene.entities) if entity is not None}
        for row, entity in enumerate(scene.scene.entities):
            if entity in body_of:
                pose[body_of[entity]] = at + 7 * row + _POSE
        packing = cls(at + 7 * len(scene.scene.entities), pos, vel, velocity, pose)
        packing.check(scene)
        return packing

    def joints(self, packed: bytes) -> tuple[Array, Array]:
        """Positions and velocities (J,) of joints in a packed state, float64."""
        state = np.frombuffer(packed, dtype=np.float32)
        return state.take(self.joint_pos).astype(float), state.take(self.joint_vel).astype(float)

    def check(self, scene: Any) -> None:
        """Compare with what SAPIEN's getters say.

        Raises:
            EngineError: they differ.
        """
        packed = np.frombuffer(pack(scene.system, scene.scene), dtype=np.float32)
        same = packed.size == self.size
        for tree in scene.trees if same else ():
            same &= np.array_equal(packed[self.joint_pos[tree.joints]], tree.handle.get_qpos(), equal_nan=True)
            same &= np.array_equal(packed[self.joint_vel[tree.joints]], tree.handle.get_qvel(), equal_nan=True)
        for body in np.flatnonzero(scene.layout.there) if same else ():
            pose = scene.entities[body].pose
            same &= np.array_equal(packed[self.pose[body]], [*pose.p, *pose.q[1:], pose.q[0]], equal_nan=True)
            if scene.layout.free[body]:
                part = scene.bodies[body]
                both = np.concatenate([part.linear_velocity, part.angular_velocity])
                same &= np.array_equal(packed[self.velocity[body]], both, equal_nan=True)
        if not same:
            raise EngineError(
                "this SAPIEN packs the state of a scene in another order than 3.0.3, and would be read wrong; install "
                "sapien 3.0.3, or an anysim-sapien that knows this one"
            )


class Batch:
    """Places of numbers in the packed states of several scenes, one after the other."""

    def __init__(self, packings: Sequence[Packing]) -> None:
        self.packings = list(packings)
        sizes = np.array([packing.size for packing in packings])
        self.start = np.concatenate([[0], np.cumsum(sizes)])
        """(N + 1,) where each begins, and where the last ends."""
        self.joint_pos, self.joint_vel, self.velocity, self.pose = (
            np.stack([start + getattr(p, name) for start, p in zip(self.start[:-1], packings, strict=True)])
            for name in ("joint_pos", "joint_vel", "velocity", "pose")
        )

"""The equations of motion of a World's joints, engine-free: the reference that engines are compared with.

Every joint counts as a degree of freedom of its own, also one that follows another.
"""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.kinematics.inertia import tensor
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import BodyKind, JointType, World


class Equations(NamedTuple):
    """M(q) a + bias(q, v) = joint efforts.

    `mass` (J, J) with armature; `bias` (J,) [N m, N]: Coriolis and centrifugal terms and gravity, without damping,
    friction and limits.
    """

    mass: Array
    bias: Array


class Mechanism:
    """The constants of a World's links and joints, made once, for many configurations; free roots are held.

    All quantities are spatial vectors about the world's origin (angular part first), as in Featherstone's *Rigid Body
    Dynamics Algorithms* (2008): what passes the origin adds along a chain, so sums over bodies are matrix products.
    """

    def __init__(self, world: World) -> None:
        bodies, joints = world.bodies, world.joints
        self._world = world
        self._roots = world.initial_body_pose[None]
        self._body = np.array([j.body for j in joints], dtype=int)
        self._axis = np.array([j.axis for j in joints], dtype=float).reshape(-1, 3)
        self._anchor = np.array([j.anchor for j in joints], dtype=float).reshape(-1, 3)
        self._turns = np.array([j.type is JointType.REVOLUTE for j in joints], dtype=float)[:, None]
        self._armature = np.array([j.armature for j in joints], dtype=float)
        self.moved_by = _moved_by(world)
        """(B, J) of 0 and 1: which joints move which bodies."""
        links = np.array([b.kind is BodyKind.LINK for b in bodies], dtype=float)
        self._mass = np.array([b.inertial.mass for b in bodies]) * links
        self._com = np.array([b.inertial.com for b in bodies], dtype=float).reshape(-1, 3)
        self._inertia = np.array([tensor(b.inertial) for b in bodies]).reshape(-1, 3, 3) * links[:, None, None]
        weight = self._mass * np.array([not b.gravity_compensation for b in bodies], dtype=float)
        self._weight = weight[:, None] * np.asarray(world.physics.gravity)

    def motions(self, poses: Array) -> Array:
        """(J, 6) what a unit velocity of each joint adds to the motion at the world's origin; poses (B, 7)."""
        turn = poses[self._body, 3:]
        axis = P.rotate(turn, self._axis)
        anchor = poses[self._body, :3] + P.rotate(turn, self._anchor)
        return np.concatenate(
            [axis * self._turns, P.cross(anchor, axis) * self._turns + axis * (1.0 - self._turns)], axis=1
        )

    def equations(self, q: Array, v: Array) -> Equations:
        """The equations of motion at joint positions q (J,) and velocities v (J,)."""
        poses = forward_kinematics(self._world, self._roots, np.asarray(q, dtype=float)[None])[0]
        motion = self.motions(poses)
        inertia = self._spatial_inertia(poses)
        composite = np.tensordot(self.moved_by.T, inertia, axes=1)  # (J, 6, 6) of all that a joint moves
        momentum = np.einsum("jab,jb->ja", composite, motion)
        above = self.moved_by[self._body]  # (J, J): row j has the joints between the root and j, j included
        coupled = (momentum @ motion.T) * above
        mass = coupled + coupled.T - np.diag(np.diag(coupled)) + np.diag(self._armature)

        rate = motion * v[:, None]
        velocity = self.moved_by @ rate
        acceleration = self.moved_by @ _cross_motion(velocity[self._body], rate)
        moved = np.einsum("bij,bj->bi", inertia, velocity)
        force = np.einsum("bij,bj->bi", inertia, acceleration) + _cross_force(velocity, moved)
        centre = poses[:, :3] + P.rotate(poses[:, 3:], self._com)
        force -= np.concatenate([P.cross(centre, self._weight), self._weight], axis=1)
        bias = np.einsum("ja,ja->j", motion, self.moved_by.T @ force)
        return Equations(mass, bias)

    def _spatial_inertia(self, poses: Array) -> Array:
        """(B, 6, 6) about the world's origin."""
        turn = P.to_matrix(poses[:, 3:])
        centre = _skew(poses[:, :3] + P.rotate(poses[:, 3:], self._com))
        first = self._mass[:, None, None] * centre
        result = np.zeros((len(poses), 6, 6))
        result[:, :3, :3] = turn @ self._inertia @ turn.transpose(0, 2, 1) - first @ centre
        result[:, :3, 3:], result[:, 3:, :3] = first, -first
        result[:, 3:, 3:] = self._mass[:, None, None] * np.eye(3)
        return result


def _moved_by(world: World) -> Array:
    table = np.zeros((len(world.bodies), len(world.joints)))
    for i, body in enumerate(world.bodies):
        if body.kind is BodyKind.LINK:
            table[i] = table[body.parent]
            table[i, world.body_joint[i]] = 1.0
    return table


def _skew(v: Array) -> Array:
    """(n, 3, 3) matrices of the cross product with v (n, 3)."""
    result = np.zeros((len(v), 3, 3))
    result[:, 0, 1], result[:, 0, 2], result[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    return result - result.transpose(0, 2, 1)


def _cross_motion(a: Array, b: Array) -> Array:
    """The rate (n, 6) at which a motion b changes that is carried along with the velocity a."""
    angular = P.cross(a[:, :3], b[:, :3])
    return np.concatenate([angular, P.cross(a[:, :3], b[:, 3:]) + P.cross(a[:, 3:], b[:, :3])], axis=1)


def _cross_force(a: Array, f: Array) -> Array:
    """The same of a force or momentum f (n, 6)."""
    couple = P.cross(a[:, :3], f[:, :3]) + P.cross(a[:, 3:], f[:, 3:])
    return np.concatenate([couple, P.cross(a[:, :3], f[:, 3:])], axis=1)

"""Rigid-body dynamics of a World, engine-free: the reference that engines are compared with.

The generalised velocity of a World is (its J joint rates, then for each free body the velocity of its frame's origin
and its angular rate, world axes). Every joint counts as a degree of freedom of its own, also one that follows another.
Everything is written for clarity and used at build or in comparisons, not in a step.

The law of damping is for the steps of engines whose own is another one: a body that nothing touches slows down as
exp(-rate t). Over a step of `dt` a wrench of -(1 - exp(-rate dt)) / dt times its momenta does exactly that.
"""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.kinematics.inertia import tensor
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import BodyKind, JointType, World


def velocity_size(world: World) -> int:
    """V, the length of the generalised velocity."""
    return len(world.joints) + 6 * sum(body.kind is BodyKind.FREE for body in world.bodies)


def frame_jacobians(world: World, poses: Array) -> Array:
    """(B, 6, V): linear velocity of each body's frame origin, and its angular rate, per generalised velocity.

    Args:
        poses: (B, 7) of all bodies, as `forward_kinematics` and `State.body_pose` give them.
    """
    jacobian = np.zeros((len(world.bodies), 6, velocity_size(world)))
    column = len(world.joints)
    for b, body in enumerate(world.bodies):
        if body.kind is BodyKind.FREE:
            jacobian[b, :, column : column + 6] = np.eye(6)
            column += 6
        if body.kind is not BodyKind.LINK:
            continue
        parent = jacobian[body.parent]
        jacobian[b, 3:] = parent[3:]
        jacobian[b, :3] = parent[:3] + np.cross(parent[3:], poses[b, :3] - poses[body.parent, :3], axis=0)
        j = world.body_joint[b]
        joint = world.joints[j]
        axis = P.rotate(poses[b, 3:], np.array(joint.axis))
        if joint.type is JointType.PRISMATIC:
            jacobian[b, :3, j] += axis
        else:
            jacobian[b, :3, j] += np.cross(axis, -P.rotate(poses[b, 3:], np.array(joint.anchor)))
            jacobian[b, 3:, j] += axis
    return jacobian


def point_jacobian(world: World, poses: Array, body: int, point: Array) -> Array:
    """(3, V): velocity of the point of `body` that is at `point` (3,) [m] in the world now."""
    frame = frame_jacobians(world, poses)[body]
    return frame[:3] + np.cross(frame[3:], point - poses[body, :3], axis=0)


def mass_matrix(world: World, poses: Array) -> Array:
    """(V, V) [kg m^2, kg m, kg]: with armature, and before any coupling of joints that follow others.

    Args:
        poses: (B, 7) of all bodies.
    """
    matrix = np.zeros((velocity_size(world),) * 2)
    for body, pose, jacobian in zip(world.bodies, poses, frame_jacobians(world, poses), strict=True):
        if body.kind is BodyKind.STATIC:
            continue
        turn = P.to_matrix(pose[3:])
        linear = jacobian[:3] + np.cross(jacobian[3:], turn @ np.array(body.inertial.com), axis=0)
        matrix += body.inertial.mass * linear.T @ linear
        matrix += jacobian[3:].T @ turn @ tensor(body.inertial) @ turn.T @ jacobian[3:]
    armature = [joint.armature for joint in world.joints]
    matrix[range(len(armature)), range(len(armature))] += armature
    return matrix


def coupling(world: World) -> Array:
    """(V, U): generalised velocities by the U that are independent; a joint that follows another moves with it."""
    size, joints = velocity_size(world), world.joints
    independent = [v for v in range(size) if v >= len(joints) or joints[v].mimic is None]
    matrix = np.zeros((size, len(independent)))
    for v in range(size):
        factor, leader = 1.0, v
        while leader < len(joints) and (mimic := joints[leader].mimic) is not None:
            factor, leader = factor * mimic.multiplier, mimic.joint
        matrix[v, independent.index(leader)] = factor
    return matrix


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


def gain(rate: Array, dt: float) -> Array:
    """[1/s] the share of its momentum that a body loses in a step, over the step."""
    return -np.expm1(-rate * dt) / dt


def drag(gains: Array, mass: Array, moments: Array, axes: Array, velocity: Array, rate: Array) -> Array:
    """Wrenches (..., 6) [N, N m] at the centres of mass, world axes.

    Args:
        gains: (..., 2) of `gain`, linear and angular.
        mass: (...,) [kg].
        moments: (..., 3) principal moments [kg m^2].
        axes: (..., 4) the orientation of the principal axes in the world.
        velocity: (..., 3) of the centres of mass [m/s].
        rate: (..., 3) angular [rad/s].
    """
    force = -(gains[..., :1] * mass[..., None]) * velocity
    turning = P.rotate(axes, moments * P.rotate_inverse(axes, rate))
    return np.concatenate([force, -gains[..., 1:] * turning], axis=-1)

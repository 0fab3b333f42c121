"""Rigid-body dynamics of a World, engine-free: Jacobians, the mass matrix, followers, and the law of damping.

The generalised velocity of a World is (its J joint rates, then for each free body the velocity of its frame's origin
and its angular rate, world axes). Every joint counts as a degree of freedom of its own, also one that follows another.
Everything is written for clarity and used at build or in comparisons, not in a step.

The law of damping is for the steps of engines whose own is another one: a body that nothing touches slows down as
exp(-rate t). Over a step of `dt` a wrench of -(1 - exp(-rate dt)) / dt times its momenta does exactly that.
"""

import numpy as np

from anysim.conventions import Array
from anysim.kinematics.inertia import tensor
from anysim.math import matrix as M, pose as P
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
        linear = jacobian[:3] + np.cross(jacobian[3:], P.rotate(pose[3:], np.array(body.inertial.com)), axis=0)
        matrix += body.inertial.mass * M.product(linear.T, linear)
        angular = M.product(turn.T, jacobian[3:])
        matrix += M.product(angular.T, tensor(body.inertial), angular)
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

"""Rigid-body dynamics of a World, engine-free: Jacobians, the mass matrix, followers, and the law of damping.

The generalised velocity of a World is (its J joint rates, then for each free body the velocity of its frame's origin
and its angular rate, world axes). Every joint counts as a degree of freedom of its own, also one that follows another.
Everything is written for clarity and used at build or in comparisons, not in a step.

The law of damping is for the steps of engines whose own is another one: a body that nothing touches slows down as
exp(-rate t). Over a step of `dt` a wrench of -(1 - exp(-rate dt)) / dt times its momenta does exactly that.
"""

from collections.abc import Sequence

import numpy as np

from anysim.conventions import Array
from anysim.kinematics.inertia import tensor
from anysim.math import matrix as M, pose as P
from anysim.model.world import BodyKind, JointType, World


def driven_trees(world: World) -> list[list[int]]:
    """The bodies of each tree that has a drive, in order; trees whose joints follow each other are one.

    What a drive does is a matter of its tree alone: the mass matrix of a world is that of its trees, side by side.
    """
    root = [-1] * len(world.bodies)
    for b, body in enumerate(world.bodies):
        root[b] = root[body.parent] if body.kind is BodyKind.LINK else b
    joined = {tree: tree for tree in root}
    for joint in world.joints:
        if joint.mimic is not None:
            ours, theirs = joined[root[joint.body]], joined[root[world.joints[joint.mimic.joint].body]]
            joined = {tree: theirs if into == ours else into for tree, into in joined.items()}
    trees: dict[int, list[int]] = {joined[root[world.joints[a.joint].body]]: [] for a in world.actuators}
    for b, tree in enumerate(root):
        if joined[tree] in trees:
            trees[joined[tree]].append(b)
    return list(trees.values())


def joints_of(world: World, bodies: Sequence[int]) -> list[int]:
    """The joints that move some bodies, in order."""
    return sorted(world.body_joint[b] for b in bodies if world.bodies[b].kind is BodyKind.LINK)


def frame_jacobians(world: World, poses: Array, bodies: Sequence[int] | None = None) -> Array:
    """(B, 6, V): linear velocity of each body's frame origin, and its angular rate, per generalised velocity.

    Args:
        poses: (B, 7) of all bodies, as `forward_kinematics` and `State.body_pose` give them.
        bodies: those of some trees, in order: B and V are theirs.
    """
    chosen = range(len(world.bodies)) if bodies is None else bodies
    joints = list(range(len(world.joints))) if bodies is None else joints_of(world, bodies)
    row, at = {b: i for i, b in enumerate(chosen)}, {j: i for i, j in enumerate(joints)}
    free = sum(world.bodies[b].kind is BodyKind.FREE for b in chosen)
    jacobian = np.zeros((len(chosen), 6, len(joints) + 6 * free))
    column = len(joints)
    for i, b in enumerate(chosen):
        body = world.bodies[b]
        if body.kind is BodyKind.FREE:
            jacobian[i, :, column : column + 6] = np.eye(6)
            column += 6
        if body.kind is not BodyKind.LINK:
            continue
        parent = jacobian[row[body.parent]]
        jacobian[i, 3:] = parent[3:]
        jacobian[i, :3] = parent[:3] + np.cross(parent[3:], poses[b, :3] - poses[body.parent, :3], axis=0)
        joint, j = world.joints[world.body_joint[b]], at[world.body_joint[b]]
        axis = P.rotate(poses[b, 3:], np.array(joint.axis))
        if joint.type is JointType.PRISMATIC:
            jacobian[i, :3, j] += axis
        else:
            jacobian[i, :3, j] += np.cross(axis, -P.rotate(poses[b, 3:], np.array(joint.anchor)))
            jacobian[i, 3:, j] += axis
    return jacobian


def mass_matrix(world: World, poses: Array, bodies: Sequence[int] | None = None) -> Array:
    """(V, V) [kg m^2, kg m, kg]: with armature, and before any coupling of joints that follow others.

    Args:
        poses: (B, 7) of all bodies.
        bodies: those of some trees, in order: V is theirs.
    """
    chosen = range(len(world.bodies)) if bodies is None else bodies
    joints = list(range(len(world.joints))) if bodies is None else joints_of(world, bodies)
    jacobians = frame_jacobians(world, poses, bodies)
    matrix = np.zeros((jacobians.shape[2],) * 2)
    for b, jacobian in zip(chosen, jacobians, strict=True):
        body, pose = world.bodies[b], poses[b]
        if body.kind is BodyKind.STATIC:
            continue
        turn = P.to_matrix(pose[3:])
        linear = jacobian[:3] + np.cross(jacobian[3:], P.rotate(pose[3:], np.array(body.inertial.com)), axis=0)
        matrix += body.inertial.mass * M.product(linear.T, linear)
        angular = M.product(turn.T, jacobian[3:])
        matrix += M.product(angular.T, tensor(body.inertial), angular)
    armature = [world.joints[j].armature for j in joints]
    matrix[range(len(armature)), range(len(armature))] += armature
    return matrix


def coupling(world: World, bodies: Sequence[int] | None = None) -> Array:
    """(V, U): generalised velocities by the U that are independent; a joint that follows another moves with it.

    With `bodies`, those of some trees.
    """
    chosen = range(len(world.bodies)) if bodies is None else bodies
    own = list(range(len(world.joints))) if bodies is None else joints_of(world, bodies)
    free = 6 * sum(world.bodies[b].kind is BodyKind.FREE for b in chosen)
    leaders = [j for j in own if world.joints[j].mimic is None]
    column = {j: i for i, j in enumerate(leaders)}
    matrix = np.zeros((len(own) + free, len(leaders) + free))
    for v, joint in enumerate(own):
        factor, leader = 1.0, joint
        while (mimic := world.joints[leader].mimic) is not None:
            factor, leader = factor * mimic.multiplier, mimic.joint
        matrix[v, column[leader]] = factor
    matrix[len(own) :, len(leaders) :] = np.eye(free)
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

"""Equations of motion of trees of joints: M(q) a + c(q, v) = torques, from the Jacobians of the neutral model."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.kinematics.dynamics import frame_jacobians, mass_matrix
from anysim.kinematics.inertia import tensor
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import World

NUDGE = 1e-5
"""[s] over which the change of Jacobians is taken, to both sides."""


class Drives(NamedTuple):
    """What the drives of one env are told: gains and targets (A,), already by mode, and the joints (A,) they turn."""

    joint: Array
    kp: Array
    kd: Array
    limit: Array
    position: Array
    velocity: Array
    effort: Array


def body_poses(world: World, roots: Array, q: Array) -> Array:
    """(B, 7): poses of all bodies at joint positions q (J,); those of fixed ones are taken from `roots` (B, 7)."""
    return forward_kinematics(world, roots[None], q[None])[0]


def body_twists(world: World, roots: Array, q: Array, v: Array) -> Array:
    """(B, 6): velocities of frame origins and angular rates, world axes."""
    return frame_jacobians(world, body_poses(world, roots, q)) @ v


def bias(world: World, roots: Array, q: Array, v: Array) -> Array:
    """(J,): torques that hold the mechanism on its way at constant joint rates, against gravity and inertia."""
    poses = body_poses(world, roots, q)
    here = _centre_jacobians(world, poses)
    later, before = (_centre_jacobians(world, body_poses(world, roots, q + s * NUDGE * v)) for s in (1.0, -1.0))
    drift = (later - before) @ v / (2.0 * NUDGE)  # accelerations (B, 6) at constant joint rates
    total = np.zeros(len(q))
    for number, body in enumerate(world.bodies):
        part, (linear, angular) = body.inertial, (here[number, :3], here[number, 3:])
        turn = P.to_matrix(poses[number, 3:])
        inertia = turn @ tensor(part) @ turn.T
        weight = np.zeros(3) if body.gravity_compensation else np.array(world.physics.gravity)
        rate = angular @ v
        total += linear.T @ (part.mass * (drift[number, :3] - weight))
        total += angular.T @ (inertia @ drift[number, 3:] + np.cross(rate, inertia @ rate))
    return total


def _centre_jacobians(world: World, poses: Array) -> Array:
    """(B, 6, J): those of the centres of mass."""
    jacobians = frame_jacobians(world, poses)
    for number, body in enumerate(world.bodies):
        arm = P.rotate(poses[number, 3:], np.array(body.inertial.com))
        jacobians[number, :3] += np.cross(jacobians[number, 3:], arm, axis=0)
    return jacobians


def advance(
    world: World, roots: Array, q: Array, v: Array, damping: Array, drives: Drives
) -> tuple[Array, Array, Array]:
    """Positions, velocities and what the drives exerted (J,) after one physics step."""
    dt, joints = world.physics.dt, len(q)
    mass, rest = mass_matrix(world, body_poses(world, roots, q)), bias(world, roots, q, v) + damping * v
    law, gain = np.zeros(joints), np.zeros(joints)
    at = drives.joint
    law[at] = drives.kp * (drives.position - q[at]) + drives.kd * (drives.velocity - v[at]) + drives.effort
    gain[at] = drives.kd
    # the damping of the law is that of the step's end: what the law asks for then is found first, and clipped after
    wanted = np.linalg.solve(mass + dt * np.diag(damping + gain), law - rest)
    exerted = np.zeros(joints)
    exerted[at] = np.clip((law - dt * gain * wanted)[at], -drives.limit, drives.limit)
    v = v + dt * np.linalg.solve(mass + dt * np.diag(damping), exerted - rest)
    return q + dt * v, v, exerted


def stopped(world: World, q: Array, v: Array) -> tuple[Array, Array]:
    """The same inside the limits: a joint that meets one stays there, and loses its speed."""
    lower, upper = np.array([[j.lower, j.upper] for j in world.joints]).reshape(-1, 2).T
    inside = np.clip(q, lower, upper)
    return inside, np.where(inside == q, v, 0.0)

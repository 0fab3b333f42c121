"""Layer `kinematics`: at the same joint positions, where are the links, how do they move, and how heavy are they?

Everything is compared with the neutral model's own arithmetic in double precision, so each engine stands for itself.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from anysim.compile.edit import unseen
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.kinematics.dynamics import coupling, frame_jacobians
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import World
from anysim_parity.engines import Engines, in_world, moves_by_force, on_each
from anysim_parity.mechanism import Mechanism
from anysim_parity.result import Gap, Layer, Measure
from anysim_parity.variants import loose

POSITION, ANGLE = 1e-6, 2e-6
"""[m] and [rad] between a link and the neutral model: single precision leaves about 5e-7 a metre from the origin."""

JOINT = 1e-6
"""[rad or m] between the joint position that was written and the one that is read: single precision at 4 rad."""

JACOBIAN = 1e-5
"""[m/s, rad/s] for 1 rad/s or 1 m/s: the error of a pose, over an arm of some metres."""

MASS = 1e-4
"""Relative error of the kinetic energy, over all directions of motion: single precision over a chain of links."""

CONFIGURATIONS, MASS_CONFIGURATIONS = 10, 3

_QUESTION = "At the same joint positions, are the links at the same places, with the same Jacobians and masses?"


class Places(NamedTuple):
    """What one engine says at the configurations: poses (C, B, 7), joint positions (C, J), Jacobians (C, B, 6, L)."""

    pose: Array
    joint: Array
    jacobian: Array


def kinematics_layer(world: World, engines: Engines, *, seed: int = 0) -> Layer:
    """Compare link poses and Jacobians at random joint positions, and mass matrices where forces act."""
    world = unseen(world)
    q = random_positions(world, CONFIGURATIONS, np.random.default_rng(seed))
    places = on_each(engines, in_world(world, lambda engine: _places(engine, q)))
    truth = _truth(world, q)
    measures = [
        Measure("link position: largest error", "m", _worst(places.found, truth, _position), 0.0, POSITION),
        Measure("link orientation: largest error", "rad", _worst(places.found, truth, _angle), 0.0, ANGLE),
        Measure("joint position: written and read", "rad", _worst(places.found, truth, _joint), 0.0, JOINT),
        Measure("Jacobian: largest error", "m/s or rad/s", _worst(places.found, truth, _twist), 0.0, JACOBIAN),
    ]
    freed = loose(world)
    masses = on_each(
        {name: engines[name] for name in places.found},
        in_world(freed, lambda engine: mass_error(engine, q[:MASS_CONFIGURATIONS]) if moves_by_force(engine) else None),
    )
    errors = {name: error for name, error in masses.found.items() if error is not None}
    if errors:
        measures.append(Measure("mass matrix: largest error of the kinetic energy", "", errors, 0.0, MASS))
    gaps = tuple(gap for a, b in combinations(places.found, 2) for gap in _gaps(a, b, places.found[a], places.found[b]))
    return Layer("kinematics", _QUESTION, tuple(measures), refused={**masses.refused, **places.refused}, gaps=gaps)


def random_positions(world: World, count: int, rng: np.random.Generator) -> Array:
    """(count, J) within the limits, at most half a turn from 0; followers follow."""
    lower = np.array([max(j.lower, -np.pi) for j in world.joints])
    upper = np.array([min(j.upper, np.pi) for j in world.joints])
    q = lower + (upper - lower) * rng.random((count, len(lower)))
    for i, joint in enumerate(world.joints):  # a follower's leader may come later and follow another in turn
        leader, factor, offset = i, 1.0, 0.0
        while (mimic := world.joints[leader].mimic) is not None:
            offset += factor * mimic.offset
            factor *= mimic.multiplier
            leader = mimic.joint
        if joint.mimic is not None:
            q[:, i] = factor * q[:, leader] + offset
    return q


def mass_error(engine: SimEngine, q: Array) -> float:
    """The largest relative error of the kinetic energy at joint positions q (C, J), of an engine with a loose world.

    From rest an effort u gives the velocity dt M^-1 u. The efforts are the columns of L in M = L L^T, for which L^T
    M^-1 L is the identity: what is missing from it is the error in units of the energy, whatever those of the joints.
    """
    mechanism, dt = Mechanism(engine.world), engine.world.physics.dt
    worst = 0.0
    for row in q:
        root = np.linalg.cholesky(mechanism.equations(row, np.zeros(len(row))).mass)
        answer = np.empty_like(root)
        for column in range(len(row)):
            engine.reset()
            engine.set_joint_state(row, np.zeros(len(row)))
            engine.set_control(effort=root[:, column])
            engine.step()
            answer[:, column] = engine.get_state().joint_vel[0] / dt
        worst = max(worst, float(np.linalg.norm(root.T @ answer - np.eye(len(row)), 2)))
    return worst


# ---------------------------------------------------------------------------------------------------------- one engine


def _places(engine: SimEngine, q: Array) -> Places:
    leaders = _leaders(engine.world)
    still = np.zeros(len(leaders))
    poses, joints, jacobians = [], [], []
    for row in q:
        engine.set_joint_state(row[leaders], still, joints=leaders)
        state = engine.get_state()
        poses.append(state.body_pose[0])
        joints.append(state.joint_pos[0])
        columns = []
        for unit in np.eye(len(leaders)):
            engine.set_joint_state(velocity=unit, joints=leaders)
            columns.append(engine.get_state().body_twist[0])
        jacobians.append(np.stack(columns, axis=-1) if columns else np.zeros((len(poses[0]), 6, 0)))
    return Places(np.array(poses), np.array(joints), np.array(jacobians))


def _truth(world: World, q: Array) -> Places:
    roots = np.repeat(world.initial_body_pose[None], len(q), axis=0)
    poses = forward_kinematics(world, roots, q)
    joints = len(world.joints)
    together = coupling(world)[:joints, : len(_leaders(world))]
    return Places(poses, q, np.array([frame_jacobians(world, pose)[..., :joints] @ together for pose in poses]))


def _leaders(world: World) -> Array:
    return np.array([i for i, joint in enumerate(world.joints) if joint.mimic is None], dtype=int)


# ---------------------------------------------------------------------------------------------------------- comparisons


def _position(a: Places, b: Places) -> Array:
    return P.norm(a.pose[..., :3] - b.pose[..., :3])


def _angle(a: Places, b: Places) -> Array:
    return P.angle_between(a.pose[..., 3:], b.pose[..., 3:])


def _joint(a: Places, b: Places) -> Array:
    return np.abs(a.joint - b.joint)


def _twist(a: Places, b: Places) -> Array:
    return np.abs(a.jacobian - b.jacobian)


def _worst(found: dict[str, Places], truth: Places, difference) -> dict[str, float]:  # noqa: ANN001
    return {name: float(difference(places, truth).max(initial=0.0)) for name, places in found.items()}


def _gaps(first: str, second: str, a: Places, b: Places) -> list[Gap]:
    # both may be off by the tolerance, in opposite directions
    return [
        Gap("link position", "m", first, second, float(_position(a, b).max(initial=0.0)), 2 * POSITION),
        Gap("link orientation", "rad", first, second, float(_angle(a, b).max(initial=0.0)), 2 * ANGLE),
        Gap("Jacobian", "m/s or rad/s", first, second, float(_twist(a, b).max(initial=0.0)), 2 * JACOBIAN),
    ]

"""Gains from inertia and weight: a critically damped oscillator of a stated bandwidth that does not sag visibly."""

from typing import NamedTuple

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.kinematics.pinocchio_model import RobotModel
from anysim_robots.drafting.guess import alone

BANDWIDTH = 5.0
"""[Hz]"""
ROTOR = 0.1
"""Armature as a share of the inertia that the joint sees: keeps the last links of a chain from being too light."""
SAG = 0.01
"""[rad] or [m] how far at most a weight that nothing else bears may move a joint from home."""
STANDING = 4.0
"""[m] Of a robot on legs kp is at least this times its weight, so that the legs do not sag visibly."""
SETTLING = 0.03
"""[s] and kd at least this times kp, so that it comes to rest."""


class Gains(NamedTuple):
    """Of one drive."""

    kp: float
    kd: float
    armature: float


def gains(model: ImportedModel, floating: bool, legs: frozenset[str], weighed: bool = False) -> dict[str, Gains]:
    """By joint, from the inertia that it moves at the initial positions: kp = I w^2, kd = 2 I w.

    What follows a joint is moved by it. A joint with armature in the source keeps it, which the inertia has in it. With
    `weighed` nothing compensates the weight that a joint bears there: kp is at least what holds it within `SAG`.
    """
    own = {joint.name: joint.armature for joint in model.joints}
    robot = RobotModel(alone(model, floating), "robot")
    first, q = 6 if floating else 0, robot.q(robot.initial)
    still = np.zeros(first + len(robot.joint_names))
    moved = _moved(model, robot)
    inertia = ((robot.mass_matrix(q)[first:, first:] @ moved) * moved).sum(axis=0)
    weight = np.abs(robot.inverse_dynamics(q, still, still)[first:] @ moved) if weighed else np.zeros(len(inertia))
    omega = 2 * np.pi * BANDWIDTH
    found: dict[str, Gains] = {}
    for name, seen, load in zip(robot.joint_names, inertia, weight, strict=True):
        armature = own[name] or ROTOR * float(seen)
        whole = float(seen) + (0.0 if own[name] else armature)
        kp = max(whole * omega**2, float(load) / SAG)
        kd = 2 * float(np.sqrt(whole * kp))
        if name in legs:
            kp = max(kp, STANDING * robot.mass * 9.81)
            kd = max(kd, SETTLING * kp)
        found[name] = Gains(_rounded(kp), _rounded(kd), _rounded(armature))
    return found


def _moved(model: ImportedModel, robot: RobotModel) -> Array:
    """(J, J): how far each joint, of the rows, goes for each unit of one of the columns, at the initial positions."""
    number = {name: row for row, name in enumerate(robot.joint_names)}
    rates = np.eye(len(number))
    for joint in model.joints:  # followers of followers too
        row, rate, at = number[joint.name], 1.0, joint
        while at.mimic is not None:
            leader = model.joints[at.mimic.joint]
            rate, at = rate * at.mimic.rate(leader.initial), leader
        if at is not joint:
            rates[row, number[at.name]] = rate
    return rates


def _rounded(value: float) -> float:
    """Two digits: it is a guess."""
    return float(f"{value:.2g}")

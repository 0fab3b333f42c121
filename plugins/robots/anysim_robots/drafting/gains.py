"""Gains from inertia: what makes a joint a critically damped oscillator of a stated bandwidth."""

from typing import NamedTuple

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.kinematics.pinocchio_model import RobotModel
from anysim_robots.drafting.guess import alone

BANDWIDTH = 5.0
"""[Hz]"""
ROTOR = 0.1
"""Armature as a share of the inertia that the joint sees: keeps the last links of a chain from being too light."""
STANDING = 2.0
"""[m] Of a robot on legs kp is at least this times its weight, so that the legs do not sag visibly."""
SETTLING = 0.03
"""[s] and kd at least this times kp, so that it comes to rest."""


class Gains(NamedTuple):
    """Of one drive."""

    kp: float
    kd: float
    armature: float


def gains(model: ImportedModel, floating: bool, legs: frozenset[str]) -> dict[str, Gains]:
    """By joint, from the diagonal of the mass matrix at the initial positions: kp = I w^2, kd = 2 I w.

    A joint with armature in the source keeps it, which the mass matrix has in it.
    """
    own = {joint.name: joint.armature for joint in model.joints}
    robot = RobotModel(alone(model, floating), "robot")
    inertia = np.diag(robot.mass_matrix(robot.q(robot.initial)))[6 if floating else 0 :]
    omega = 2 * np.pi * BANDWIDTH
    found: dict[str, Gains] = {}
    for name, seen in zip(robot.joint_names, inertia, strict=True):
        armature = own[name] or ROTOR * float(seen)
        whole = float(seen) + (0.0 if own[name] else armature)
        kp, kd = whole * omega**2, 2 * whole * omega
        if name in legs:
            kp = max(kp, STANDING * robot.mass * 9.81)
            kd = max(kd, SETTLING * kp)
        found[name] = Gains(_rounded(kp), _rounded(kd), _rounded(armature))
    return found


def _rounded(value: float) -> float:
    """Two digits: it is a guess."""
    return float(f"{value:.2g}")

"""Efforts that a motion of a robot's joints takes: inertia, gyration, damping, springs, friction and weight."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.controllers.robot import ControlledRobot
from anysim.conventions import Array

CarryWeight = Annotated[
    bool | None,
    Field(
        description="carry the weight of the links; if not given, on a fixed base and unless the catalogue says "
        "that the robot cancels it. A robot that stands is carried by the controller of its legs"
    ),
]


CREEP = 0.02
"""[rad/s], [m/s] Dry friction is made up for by its tanh of the wanted rate over this: none at rest, where it holds."""


class LinkEffort:
    """Inverse dynamics of one robot whose base does not accelerate.

    Attributes:
        carries: whether the weight is part of it. Where the engine cancels weight it never is.
    """

    def __init__(self, robot: ControlledRobot, carry_weight: bool | None = None) -> None:
        self._model = robot.kinematics
        self._floating = 6 if robot.floating else 0
        self._damping = np.array([robot.world.joints[j].damping for j in robot.joints])
        self._stiffness = np.array([robot.world.joints[j].stiffness for j in robot.joints])
        self._rest = np.array([robot.world.joints[j].spring_rest for j in robot.joints])
        self._friction = np.array([robot.world.joints[j].friction for j in robot.joints])
        entry = robot.robot.entry
        cancelled = entry is not None and entry.gravity_compensation
        self.carries = not cancelled and (not robot.floating if carry_weight is None else carry_weight)
        self._still = np.zeros(self._model.model.nv)

    def of(
        self, joint_pos: Array, joint_vel: Array, acceleration: Array, base: Array, wanted_vel: Array | None = None
    ) -> Array:
        """Efforts (J,) [N m], [N] of a state and an acceleration (J,) each; the base's world pose (7,) tells up.

        Dry friction is made up for in the direction of `wanted_vel` (J,), or of `joint_vel` where that is a reference.
        It is never more than the friction itself, which works against any other motion: together they only brake.
        """
        model = self._model
        q = model.q(joint_pos, base)
        effort = model.inverse_dynamics(q, model.v(joint_vel), model.v(acceleration))
        if not self.carries:
            effort = effort - model.inverse_dynamics(q, self._still, self._still)
        wanted = joint_vel if wanted_vel is None else wanted_vel
        passive = self._damping * joint_vel + self._stiffness * (joint_pos - self._rest)
        return effort[self._floating :] + passive + self._friction * np.tanh(wanted / CREEP)

"""Probe: go straight to a place until a contact force is felt, and straight back from there."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.references import ContactView
from anysim.task.scene import Frame, RobotView
from anysim_skills.arm import Arm
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.moving.retract import RetractMoveL
from anysim_skills.moving.servo import ServoL, ServoLimits


class Probe(PhasedSkill):
    """Bring the tool of `robot` straight to `goal`, as it is turned, until `sensor` feels `force`; then back.

    It fails with `missed_contact` where nothing is met on the way, with `jammed` where something is behind the tool.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        goal: Frame,
        sensor: ContactView,
        force: Annotated[float, Field(gt=0, description="[N] at which the tool stops")] = 5.0,
        tool: str = "tool",
        solver: str = "numba_ik",
        lead: Annotated[
            float, Field(gt=0, description="[m] of the command before the tool, which bounds the force")
        ] = 0.02,
        speed: Speed = 0.05,
        retreat: Metres = 0.08,
        retreat_speed: Speed = 0.2,
        steps: Annotated[int, Field(ge=1, description="control steps that the way may take")] = 600,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver)
        self.servo = ServoL(self.arm, ServoLimits(speed=speed, lead=lead, force=force))
        self.back = RetractMoveL(self.arm, speed=retreat_speed, lead=lead)
        self._goal, self._sensor, self._retreat, self._late = goal, sensor, retreat, steps
        self._begun = np.zeros((env.num_envs, 7))
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("approach", self._enter, self._approach, self._late),
            Phase("retreat", self._leave_contact, self.back.step, self._late),
        )

    def retry(self, rung: Rung, env: int) -> int | None:
        """None: there is one line to go, and what was felt on it stays so."""
        del rung, env
        return None

    def _enter(self, ids: Array, at: Array) -> None:
        self.servo.begin(ids)
        self._begun[ids] = self.arm.tool.pose[at]
        self.arm.closed[ids] = True

    def _approach(self, ids: Array, at: Array) -> Array:
        target = np.concatenate([self._goal.position[at], self._begun[ids, 3:]], axis=1)
        servo = self.servo.step(ids, at, target, self._sensor.strength[at])
        return np.where(servo.gated, GO_ON, np.where(servo.arrived, _MISSED, STAY))

    def _leave_contact(self, ids: Array, at: Array) -> None:
        way = self._begun[ids, :3] - self._goal.position[at]
        self.back.begin(ids, at, self._retreat * way / np.maximum(P.norm(way), 1e-9)[:, None])


_MISSED = OUTCOMES.index(Outcome.MISSED_CONTACT)

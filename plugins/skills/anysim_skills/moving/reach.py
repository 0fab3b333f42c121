"""Reach: bring the tool to a goal and keep it there."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim_skills.arm import Arm
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.planning import LATENCY, Latency, PlannerName
from anysim_skills.recovery.homing import Homing

STUCK = 25
"""Control steps without inverse kinematics after which a goal counts as out of reach."""


class Reach(PhasedSkill):
    """Bring the tool of `robot` to `goal`; it keeps its orientation unless `orientation` is true."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        goal: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        orientation: bool = False,
        speed: Speed = 0.4,
        tolerance: Metres = 0.01,
        hold: Annotated[int, Field(ge=1, description="control steps")] = 10,
        steps: Annotated[int, Field(ge=1, description="control steps that the way may take")] = 200,
        planner: PlannerName = "",
        latency: Latency = LATENCY,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver, planner=planner, latency=latency)
        self._plans = bool(planner)
        self._goal, self._turning, self._speed, self._tolerance = goal, orientation, speed, tolerance
        self._hold, self._late = hold, steps
        self._turn = np.zeros((env.num_envs, 4))
        self._held, self._stuck = np.zeros((2, env.num_envs), dtype=np.int64)
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        move = Phase("move", self._enter, self._move, self._late)
        return (self.arm.planned_phase(self._plan), move) if self._plans else (move,)

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, opens=False).phases()

    def _plan(self, ids: Array, at: Array) -> None:
        self._enter(ids, at)
        self.arm.plan(ids, self._target(ids, at)[:, None])

    def _target(self, ids: Array, at: Array) -> Array:
        goal = self._goal.pose[at]
        return goal if self._turning else np.concatenate([goal[:, :3], self._turn[ids]], axis=1)

    def _enter(self, ids: Array, at: Array) -> None:
        self._turn[ids] = self.arm.tool.quaternion[at]
        self._held[ids] = self._stuck[ids] = 0

    def _move(self, ids: Array, at: Array) -> Array:
        goal = self._goal.pose[at]
        self.arm.go(ids, self._target(ids, at), self._speed)
        there = P.norm(goal[:, :3] - self.arm.tool.position[at]) < self._tolerance
        if self._turning:
            there &= P.angle_between(self.arm.tool.quaternion[at], goal[:, 3:]) < 10 * self._tolerance
        self._held[ids] = (self._held[ids] + 1) * there
        self._stuck[ids] = (self._stuck[ids] + 1) * self.arm.stuck[ids]
        return np.where(
            self._stuck[ids] > STUCK,
            OUTCOMES.index(Outcome.NO_IK),
            np.where(self._held[ids] >= self._hold, GO_ON, STAY),
        )

"""Press: push a button or a switch along its normal, and let go of it."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.joints import RangedJointView
from anysim.task.scene import Frame, RobotView
from anysim_skills.arm import Arm
from anysim_skills.choice import Choice, turns_against
from anysim_skills.grasping.grasp import Speed
from anysim_skills.planning import LATENCY, Latency, PlannerName
from anysim_skills.recovery.homing import Homing

TURNS = 8
"""Orientations of the hand about the normal that are tried."""
_CLOSING = 20


class Press(PhasedSkill):
    """Press `button`, whose frame's z points out of it, with the closed fingers of `robot` until `part` has moved."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        button: Frame,
        part: RangedJointView,
        tool: str = "tool",
        solver: str = "numba_ik",
        fraction: Annotated[float, Field(gt=0, le=1, description="of the joint's range that counts as pressed")] = 0.8,
        clear: Annotated[float, Field(gt=0, description="[m] before the button, before and afterwards")] = 0.06,
        beyond: Annotated[float, Field(gt=0, description="[m] how far below the button the tool is commanded")] = 0.03,
        speed: Speed = 0.3,
        press_speed: Speed = 0.08,
        hold: Annotated[int, Field(ge=1, description="control steps")] = 5,
        planner: PlannerName = "",
        latency: Latency = LATENCY,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver, planner=planner, latency=latency)
        self._plans = bool(planner)
        self._button, self._part, self._fraction = button, part, fraction
        self._clear, self._beyond, self._speed, self._press_speed, self._hold = clear, beyond, speed, press_speed, hold
        n = env.num_envs
        self._turn = np.zeros((n, 4))
        self._choice, self._held = Choice(n, TURNS), np.zeros(n, dtype=np.int64)
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("choose", self._choose, self._chosen, 1),
            *([self.arm.planned_phase(self._plan)] if self._plans else ()),
            Phase("approach", None, self._approach, 200),
            Phase("press", self._forget, self._press, 120),
            Phase("retreat", None, self._retreat, 100),
        )

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, opens=False).phases()

    def retry(self, rung: Rung, env: int) -> int | None:
        return self._choice.retry(rung, env, same=(Rung.BACK_OFF,))

    def _at(self, at: Array, turn: Array, out: float) -> Array:
        """Tool poses (n, 7), `out` [m] above the button along its normal."""
        button = self._button.pose[at]
        normal = P.rotate(button[:, 3:], np.broadcast_to(np.array([0.0, 0.0, 1.0]), (len(button), 3)))
        return np.concatenate([button[:, :3] + out * normal, turn], axis=1)

    def _choose(self, ids: Array, at: Array) -> None:
        turns = turns_against(self._button.pose[at][:, 3:], TURNS)
        ways = [[self._at(at, turns[:, k], out) for out in (self._clear, -self._beyond)] for k in range(TURNS)]
        targets = np.moveaxis(np.array(ways), 2, 0)
        self._turn[ids] = turns[np.arange(len(ids)), self._choice.least_motion(self.arm, ids, targets)]
        self.arm.closed[ids] = True

    def _chosen(self, ids: Array, at: Array) -> Array:
        del at
        return np.where(self._choice.none_left(ids), OUTCOMES.index(Outcome.NO_IK), GO_ON)

    def _plan(self, ids: Array, at: Array) -> None:
        self.arm.plan(ids, self._at(at, self._turn[ids], self._clear)[:, None])

    def _approach(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._at(at, self._turn[ids], self._clear), self._speed)
        return np.where(self.arm.arrived(ids, at) & (self.steps[ids] >= _CLOSING), GO_ON, STAY)

    def _forget(self, ids: Array, at: Array) -> None:
        del at
        self._held[ids] = 0

    def _press(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._at(at, self._turn[ids], -self._beyond), self._press_speed, 0.04)
        self._held[ids] = (self._held[ids] + 1) * self.pressed(at)
        missed = (self.steps[ids] >= 20) & self.arm.arrived(ids, at)
        return np.where(self._held[ids] >= self._hold, GO_ON, np.where(missed, _MISSED, STAY))

    def pressed(self, at: Array) -> Array:
        """(n,) bool: the part has moved far enough."""
        return self._part.opening[at] >= self._fraction

    def _retreat(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._at(at, self._turn[ids], self._clear), self._speed)
        return np.where(self.arm.arrived(ids, at, 0.01, 0.1), GO_ON, STAY)


_MISSED = OUTCOMES.index(Outcome.MISSED_CONTACT)

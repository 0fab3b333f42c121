"""Release: open the gripper, wait until the fingers rest, and draw the hand back."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim_skills.arm import Arm
from anysim_skills.grasping.grasp import SETTLED, Metres, Speed
from anysim_skills.grasping.hand import Hand

OPENING_STEPS = 25


class Release(PhasedSkill):
    """Let go of whatever `robot` holds, and draw the hand back along its own approach."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        tool: str = "tool",
        solver: str = "numba_ik",
        hand: Annotated[str, Field(description="the channel of a hand with several fingers; empty: a gripper")] = "",
        retreat: Metres = 0.1,
        speed: Speed = 0.2,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver)
        self.hand = Hand.of(env, robot, channel=hand) if hand else None
        self._back, self._speed = np.array([[0.0, 0.0, -retreat, 0.0, 0.0, 0.0, 1.0]]), speed
        super().__init__(env, [self.arm] if self.hand is None else [self.arm, self.hand])

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("open", self._open, self._opening, OPENING_STEPS + 1),
            Phase("retreat", self._retreat, self._retreating, 150),
        )

    def _open(self, ids: Array, at: Array) -> None:
        del at
        self.arm.closed[ids] = False
        if self.hand is not None:
            self.hand.open(ids)
        self.arm.stay(ids)

    def _opening(self, ids: Array, at: Array) -> Array:
        del at
        still = (self.steps[ids] >= 5) & (self.arm.finger_speed(ids) < SETTLED)
        return np.where(still | (self.steps[ids] >= OPENING_STEPS), GO_ON, STAY)

    def _retreat(self, ids: Array, at: Array) -> None:
        self.arm.go(ids, P.compose(self.arm.tool.pose[at], self._back), self._speed)

    def _retreating(self, ids: Array, at: Array) -> Array:
        return np.where(self.arm.arrived(ids, at, 0.01, 0.1) | (self.steps[ids] >= 100), GO_ON, STAY)

"""MobileReach: the tool goes straight to a goal while the base below it drives to where it is to stand."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.phases import Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim_skills.arm import Arm
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.moving.base import Base
from anysim_skills.moving.mobile import MobileLimits, MobileMoveL
from anysim_skills.recovery.homing import Homing


class MobileReach(PhasedSkill):
    """Bring the tool of `robot` straight to `goal`, as it is turned, while its base drives to x, y and yaw of `stand`.

    It fails with `controller` where the tool is off its line by more than `deviation`. Obstacles are not seen.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        goal: Frame,
        stand: Frame,
        channel: str = "base",
        link: Annotated[str, Field(description="of the robot, that is driven there; its own frame where empty")] = "",
        tool: str = "tool",
        solver: str = "numba_ik",
        deviation: Metres = 0.02,
        speed: Speed = 0.2,
        base_speed: Speed = 0.3,
        base_rate: Annotated[float, Field(gt=0, description="[rad/s]")] = 0.4,
        steps: Annotated[int, Field(ge=1, description="control steps that the way may take")] = 1500,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver)
        self.base = Base.of(env, robot, channel=channel, link=link)
        self.move = MobileMoveL(self.arm, self.base, MobileLimits(speed, base_speed, base_rate, deviation))
        self._goal, self._stand, self._late = goal, stand, steps
        super().__init__(env, [self.base, self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("move", self._enter, self.move.step, self._late),)

    def make_recovery(self) -> Sequence[Phase]:
        """The arm goes home on the base, which stays: from there it is another line."""
        return Homing(self, self.arm, opens=False).phases()

    def retry(self, rung: Rung, env: int) -> int | None:
        """None: from off the line there is no way back onto it."""
        del rung, env
        return None

    def _enter(self, ids: Array, at: Array) -> None:
        target = np.concatenate([self._goal.position[at], self.arm.tool.quaternion[at]], axis=1)
        place = self._stand.pose[at]
        stand = np.concatenate([place[:, :2], P.yaw(place[:, 3:])[:, None]], axis=1)
        self.move.begin(ids, at, target, stand)

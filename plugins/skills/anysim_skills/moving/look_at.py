"""LookAt: turn a camera of a robot until it looks at something."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim_skills.moving.gaze import Gaze

NO_CLOSER = 60
"""Control steps without progress after which what is to be seen counts as out of reach."""


class LookAt(PhasedSkill):
    """Turn `camera` by the joints of `robot` that carry it, until `target` is within `angle` of its optical axis."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        camera: Annotated[str, Field(description="a camera of the world that the robot carries")],
        target: Frame,
        channel: str = "arm",
        joints: Annotated[
            tuple[str, ...], Field(description="that turn, as those of a head; all that carry the camera where empty")
        ] = (),
        angle: Annotated[float, Field(gt=0, description="[rad]")] = 0.03,
        rate: Annotated[float, Field(gt=0, description="[rad/s] of a joint")] = 1.0,
        hold: Annotated[int, Field(ge=1, description="control steps")] = 10,
        steps: Annotated[int, Field(ge=1, description="control steps that it may take")] = 500,
    ) -> None:
        self.gaze = Gaze.of(env, robot, camera, channel, joints)
        self._target, self._angle, self._rate, self._hold, self._late = target, angle, rate, hold, steps
        self._held, self._since = np.zeros((2, env.num_envs), dtype=np.int64)
        self._best = np.zeros(env.num_envs)
        super().__init__(env, [self.gaze])

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("turn", self._enter, self._turn, self._late),)

    def retry(self, rung: Rung, env: int) -> int | None:
        """The joints have gone as far as they can: another try would end there again."""
        del rung, env
        return None

    def _enter(self, ids: Array, at: Array) -> None:
        del at
        self.gaze.rate = self._rate
        self._held[ids] = self._since[ids] = 0
        self._best[ids] = np.inf

    def point(self, at: Array) -> Array:
        """(n, 3) [m] what is looked at."""
        return self._target.position[at]

    def _turn(self, ids: Array, at: Array) -> Array:
        left = self.gaze.angle(ids, self._target.position[at])
        self.gaze.look(ids, self.point(at))
        self._held[ids] = (self._held[ids] + 1) * (left < self._angle)
        closer = left < self._best[ids] - 1e-3
        self._best[ids] = np.where(closer, left, self._best[ids])
        self._since[ids] = np.where(closer | (left < self._angle), self.steps[ids], self._since[ids])
        said = np.where(self.steps[ids] - self._since[ids] > NO_CLOSER, _NO_IK, STAY)
        said = np.where(self._held[ids] >= self._hold, GO_ON, said)
        return np.where(self._target.present[at], said, _ABSENT)


_NO_IK, _ABSENT = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.ADVERSE_STATE)

"""The skill `stand`: a robot that holds its home."""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.controllers.base import Controller
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView


class Stand(Skill):
    """Keep all channels of `robot` that have a controller at its home, for as long as the episode lasts.

    Controllers that take joint positions are given those of the home. Of the others, as `humanoid_balance` and `trot`,
    the action zero is asked for, with which those stand. A base that tilts by more than `tilt` has fallen: the skill
    ends with `lost`. It never ends with `ok`, as standing has no end of its own.
    """

    phases: ClassVar[tuple[str, ...]] = ("stand",)

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        tilt: Annotated[float, Field(gt=0, description="[rad] the robot has fallen beyond it")] = 1.0,
    ) -> None:
        super().__init__(env)
        self._base, self._least = robot.base, float(np.cos(tilt))
        self._slices = [s for s in env.actions.slices if s.robot == robot.name]
        if not self._slices:
            raise TaskError(f"no channel of '{robot.name}' has a controller; add world.robots.{robot.name}.actions")
        self._homes = [robot.channel_columns(s.channel).home[None] for s in self._slices]

    def act(self, env_ids: Array, action: Array) -> None:
        self.env.scene.look(env_ids)
        for s, home in zip(self._slices, self._homes, strict=True):
            if type(s.controller).action_for is Controller.action_for:
                action[env_ids, s.start : s.stop] = 0.0
            else:
                targets = np.repeat(home, len(env_ids), axis=0)
                action[env_ids, s.start : s.stop] = s.controller.action_for(targets, env_ids)
        x, y = self._base.pose[:, 3], self._base.pose[:, 4]
        fallen = 1.0 - 2.0 * (x * x + y * y) < self._least
        self.outcome[env_ids[fallen]] = OUTCOMES.index(Outcome.LOST)

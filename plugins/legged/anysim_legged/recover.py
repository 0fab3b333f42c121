"""The skill `recover`: a robot with legs that turns onto its belly, wherever it lies, and stands up."""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.controllers.base import Controller
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.skills.base import Skill
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim_legged.stand import postured

Posture = Annotated[dict[str, float], Field(description="joint positions by name; `*` matches any part")]


class Recover(Skill):
    """Turn `robot` over until its base is level enough, and stand up to `posture` from there.

    A robot that lies on its side or back pushes with the legs of the side that is lower, from the home to `left` or
    `right`, and folds them again, until it has turned; the drives' speed is what turns it. It never ends, as standing
    has no end of its own.
    """

    phases: ClassVar[tuple[str, ...]] = ("turn", "stand")

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        posture: Posture,
        left: Posture,
        right: Posture,
        channel: str = "base",
        tilt: Annotated[float, Field(gt=0, description="[rad] beyond it the robot turns before it stands up")] = 0.93,
        waits: Annotated[float, Field(ge=0, description="time until it has come to lie [s]")] = 0.3,
        pushes: Annotated[float, Field(gt=0, description="time of a push [s]")] = 0.4,
        folds: Annotated[float, Field(gt=0, description="time between two pushes [s]")] = 0.3,
        rises: Annotated[float, Field(gt=0, description="time until the posture is reached [s]")] = 1.0,
    ) -> None:
        super().__init__(env)
        self._base, self._least = robot.base, float(np.cos(tilt))
        self._slice = env.actions.slice_of(robot.name, channel)
        if type(self._slice.controller).action_for is Controller.action_for:
            raise TaskError(f"the skill recover commands joint positions, which '{robot.name}.{channel}' does not take")
        self._home = robot.channel_columns(channel).home[None]
        self._stood, self._left, self._right = (
            postured(env, robot, self._slice, self._home, one) for one in (posture, left, right)
        )
        step = env.engine.world.physics.control_dt
        self._waits, self._rises = round(waits / step), max(1.0, rises / step)
        self._push, self._cycle = round(pushes / step), round(pushes / step) + max(1, round(folds / step))
        self._since = np.zeros(env.num_envs, dtype=np.int64)
        self._by_left = np.zeros(env.num_envs, dtype=bool)

    def begin(self, env_ids: Array) -> None:
        super().begin(env_ids)
        self.phase[env_ids] = 1
        self._since[env_ids] = -self._waits

    def act(self, env_ids: Array, action: Array) -> None:
        self.env.scene.look(env_ids)
        x, y, z, w = self._base.pose[:, 3:].T
        over = (1.0 - 2.0 * (x * x + y * y) < self._least) & (self._since[env_ids] >= 0)
        phase = np.where(over, 0, 1)
        changed = (phase != self.phase[env_ids]) & (self._since[env_ids] >= 0)
        self.phase[env_ids] = phase
        since = np.where(changed, 0, self._since[env_ids])
        self._since[env_ids] = since + 1
        within = since % self._cycle
        begins = env_ids[over & (within == 0)]
        self._by_left[begins] = (y * z + w * x < 0.0)[over & (within == 0)]  # its left is lower
        share = np.clip((since + 1.0) / self._rises, 0.0, 1.0)[:, None]
        standing = self._home + np.where(since < 0, 0.0, share[:, 0])[:, None] * (self._stood - self._home)
        push = np.where(self._by_left[env_ids, None], self._left, self._right)
        turning = np.where((within < self._push)[:, None], push, self._home)
        targets = np.where(over[:, None], turning, standing)
        action[env_ids, self._slice.start : self._slice.stop] = self._slice.controller.action_for(targets, env_ids)

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
from anysim_schemas.base import Spec

BACK = 2.1
"""[rad] A base that tilts by more lies on its back, by less on its side."""

Posture = Annotated[dict[str, float], Field(description="joint positions by name; `*` matches any part")]


class TurnSpec(Spec):
    """A push that turns a robot: the joints go to a posture, and back to the home."""

    left: Posture = Field(description="where the joints go where the robot's left is lower; at the home where unnamed")
    right: Posture = Field(description="the same where its right is lower")
    pushes: float = Field(default=0.4, gt=0, description="time at the posture [s]")
    folds: float = Field(default=0.3, gt=0, description="time at the home afterwards [s]")


class Recover(Skill):
    """Turn `robot` over until its base is level enough, and stand up to `posture` from there.

    On its back a robot tries the `turns` one after the other, on its side the last of them alone; which is meant for
    the side that is lower is decided anew for each. The skill never ends, as standing has no end of its own.
    """

    phases: ClassVar[tuple[str, ...]] = ("turn", "stand")

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        posture: Posture,
        turns: Annotated[list[TurnSpec], Field(min_length=1, description="pushes that turn it, in the order of trial")],
        channel: str = "base",
        tilt: Annotated[float, Field(gt=0, description="[rad] beyond it the robot turns before it stands up")] = 0.93,
        waits: Annotated[float, Field(ge=0, description="time until it has come to lie [s]")] = 0.3,
        rises: Annotated[float, Field(gt=0, description="time until the posture is reached [s]")] = 1.0,
    ) -> None:
        super().__init__(env)
        self._base, self._least = robot.base, float(np.cos(tilt))
        self._slice = env.actions.slice_of(robot.name, channel)
        if type(self._slice.controller).action_for is Controller.action_for:
            raise TaskError(f"the skill recover commands joint positions, which '{robot.name}.{channel}' does not take")
        self._home = robot.channel_columns(channel).home[None]
        self._stood = postured(env, robot, self._slice, self._home, posture)
        # (T, 2, K): for the left and the right that is lower
        pushed = [[postured(env, robot, self._slice, self._home, p)[0] for p in (t.left, t.right)] for t in turns]
        self._pushed = np.array(pushed)
        step = env.engine.world.physics.control_dt
        self._waits, self._rises = round(waits / step), max(1.0, rises / step)
        self._push = np.array([max(1, round(turn.pushes / step)) for turn in turns])
        self._fold = np.array([max(1, round(turn.folds / step)) for turn in turns])
        self._since, self._begun, self._turn, self._side, self._tried = np.zeros((5, env.num_envs), dtype=np.int64)

    def begin(self, env_ids: Array) -> None:
        super().begin(env_ids)
        self.phase[env_ids] = 1
        self._since[env_ids] = -self._waits
        self._tried[env_ids] = 0

    def act(self, env_ids: Array, action: Array) -> None:
        self.env.scene.look(env_ids)
        since = self._since[env_ids]
        x, y, z, w = self._base.pose[:, 3:].T
        up = 1.0 - 2.0 * (x * x + y * y)
        over = (up < self._least) & (since >= 0)
        since = np.where((since >= 0) & (over != (self.phase[env_ids] == 0)), 0, since)
        self.phase[env_ids], self._since[env_ids] = np.where(over, 0, 1), since + 1
        turn = self._turn[env_ids]
        fresh = over & ((since == 0) | (since - self._begun[env_ids] >= (self._push + self._fold)[turn]))
        new = env_ids[fresh]
        last = len(self._push) - 1
        self._turn[new] = np.where(up[fresh] < np.cos(BACK), self._tried[new] % (last + 1), last)
        self._side[new] = (y * z + w * x >= 0.0)[fresh]  # 0 where its left is lower
        self._begun[new] = since[fresh]
        self._tried[new] += 1
        turn = self._turn[env_ids]
        pushing = (since - self._begun[env_ids] < self._push[turn])[:, None]
        share = np.clip((since + 1.0) / self._rises, 0.0, 1.0) * (since >= 0)
        standing = self._home + share[:, None] * (self._stood - self._home)
        turning = np.where(pushing, self._pushed[turn, self._side[env_ids]], self._home)
        targets = np.where(over[:, None], turning, standing)
        action[env_ids, self._slice.start : self._slice.stop] = self._slice.controller.action_for(targets, env_ids)

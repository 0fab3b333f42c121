"""The skill `stand`: a robot that holds its home."""

from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.controllers.base import Controller
from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.managers.action import ActionSlice
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView


class Stand(Skill):
    """Keep all channels of `robot` that have a controller at its home, for as long as the episode lasts.

    Controllers that take joint positions are given those of the home. Of the others, as `humanoid_balance` and `trot`,
    the action zero is asked for, with which those stand. A base that tilts by more than `tilt` has fallen: the skill
    ends with `lost`. It never ends with `ok`, as standing has no end of its own. `posture` is for a robot that begins
    otherwise than it is to stand: it gets there along a straight line in joint space, in `rises`.
    """

    phases: ClassVar[tuple[str, ...]] = ("stand",)

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        tilt: Annotated[float, Field(gt=0, description="[rad] the robot has fallen beyond it")] = 1.0,
        posture: Annotated[
            dict[str, float], Field(description="joint positions other than the home's, by name; `*` matches any part")
        ] = {},  # noqa: B006  (never written to)
        rises: Annotated[float, Field(gt=0, description="time until the posture is reached [s]")] = 1.0,
    ) -> None:
        super().__init__(env)
        self._base, self._least = robot.base, float(np.cos(tilt))
        self._slices = [s for s in env.actions.slices if s.robot == robot.name]
        if not self._slices:
            raise TaskError(f"no channel of '{robot.name}' has a controller; add world.robots.{robot.name}.actions")
        self._homes = [robot.channel_columns(s.channel).home[None] for s in self._slices]
        alone = len(self._slices) == 1
        self._risen = [
            postured(env, robot, s, home, posture, alone) for s, home in zip(self._slices, self._homes, strict=True)
        ]
        self._steps = max(1.0, rises / env.engine.world.physics.control_dt)

    def act(self, env_ids: Array, action: Array) -> None:
        self.env.scene.look(env_ids)
        share = np.minimum((self.env.scene.elapsed[env_ids, None] + 1.0) / self._steps, 1.0)
        for s, home, risen in zip(self._slices, self._homes, self._risen, strict=True):
            if type(s.controller).action_for is Controller.action_for:
                action[env_ids, s.start : s.stop] = 0.0
            else:
                targets = home + share * (risen - home)
                action[env_ids, s.start : s.stop] = s.controller.action_for(targets, env_ids)
        x, y = self._base.pose[:, 3], self._base.pose[:, 4]
        fallen = 1.0 - 2.0 * (x * x + y * y) < self._least
        self.outcome[env_ids[fallen]] = OUTCOMES.index(Outcome.LOST)


def postured(
    env: TaskEnv, robot: RobotView, s: ActionSlice, home: Array, posture: Mapping[str, float], alone: bool = True
) -> Array:
    """(1, K) where the joints of a channel are to be: at `home` (1, K) but for those that a posture names.

    Raises:
        TaskError: a pattern matches no joint, and there is no other channel (`alone`) whose joint it could be.
    """
    joints = [env.engine.world.joints[j].name for j in robot.channel(s.channel).joints]
    own = [joint.removeprefix(f"{robot.name}.") for joint in joints]
    wanted = home.copy()
    for pattern, position in posture.items():
        matching = [fnmatchcase(joint, pattern) for joint in own]
        if not any(matching) and alone:
            raise TaskError(f"posture: no joint of '{robot.name}' matches '{pattern}' (joints: {listing(own, 20)})")
        wanted[0, matching] = position
    return wanted

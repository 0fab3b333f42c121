"""The skill `trot`: the gait of the controller of that name, for drives that are told joint positions."""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.controllers.base import Controller
from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.skills.base import OUTCOMES, Outcome, Skill
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim_legged.trot import TrotController


class TrotSkill(Skill):
    """Trot as the command `goal` says: forward and to the left [m/s], and turning [rad/s].

    The channel's controller takes joint positions. What the gait wants of rates and torques beside is put into them:
    kp (q + (kd qd + tau) / kp - q') - kd q' is the drive law with all three. A base that tilts by more than `tilt` has
    fallen: the skill ends with `lost`.
    """

    phases: ClassVar[tuple[str, ...]] = ("trot",)

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        goal: Annotated[str, Field(description="the key of a command of three numbers, as `tasks.velocity`")],
        channel: str = "base",
        frequency: Annotated[
            float,
            Field(gt=0, description="strides a second [1/s], the catalogue's where left out; softer legs need more"),
        ]
        | None = None,
        tilt: Annotated[float, Field(gt=0, description="[rad] the robot has fallen beyond it")] = 1.0,
    ) -> None:
        super().__init__(env)
        known = [name for name, rows in env.scene.goals.items() if rows.shape[1] == 3]
        if goal not in known:
            raise TaskError(f"there is no commanded velocity '{goal}'; task.command has {listing(known)}")
        self._slice = env.actions.slice_of(robot.name, channel)
        view = self._slice.controller.channel
        if type(self._slice.controller).action_for is Controller.action_for:
            raise TaskError(f"the skill trot commands joint positions, which '{robot.name}.{channel}' does not take")
        params = dict(view.robot.entry.channels[channel].controllers.get("trot", {}))
        if frequency is not None:
            params["frequency"] = frequency
        self._gait = TrotController(view, env.num_envs, **params)
        self._base, self._goal, self._least = robot.base, goal, float(np.cos(tilt))
        self._home = robot.channel_columns(channel).home[None]

    def begin(self, env_ids: Array) -> None:
        super().begin(env_ids)
        self._gait.reset(env_ids, np.repeat(self._home, len(env_ids), axis=0))

    def act(self, env_ids: Array, action: Array) -> None:
        self.env.scene.look(env_ids)
        view = self._gait.channel
        self._gait.robot.see(self.env.engine.get_state())
        wanted = self.env.scene.goals[self._goal][env_ids]
        command = self._gait.apply(np.minimum(np.maximum(wanted, self._gait.low), self._gait.high), env_ids)
        assert command.position is not None
        assert command.velocity is not None
        assert command.effort is not None
        targets = command.position + (view.kd * command.velocity + command.effort) / view.kp
        action[env_ids, self._slice.start : self._slice.stop] = self._slice.controller.action_for(targets, env_ids)
        x, y = self._base.pose[:, 3], self._base.pose[:, 4]
        self.outcome[env_ids[1.0 - 2.0 * (x * x + y * y) < self._least]] = OUTCOMES.index(Outcome.LOST)

"""`ToolController`: the options, frames and targets of controllers that move the tools of a channel."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import TypedDict

import numpy as np

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim_control.tools.frames import ToolFrames
from anysim_control.tools.target import (
    CommandName,
    FrameName,
    Speed,
    StepAngle,
    StepLength,
    ToolNames,
    ToolTargets,
    TurnRate,
)


class ToolOptions(TypedDict, total=False):
    """The keyword-only parameters of `ToolController`, for subclasses that hand them on."""

    tool: ToolNames
    frame: FrameName
    command: CommandName
    step_length: StepLength
    step_angle: StepAngle
    speed: Speed
    turn_rate: TurnRate


class ToolController(Controller):
    """Reads poses, positions, steps or speeds of tools from the action; a subclass is the law that follows them.

    The constructor of a subclass has keyword-only parameters of its own and `**options: Unpack[ToolOptions]`, which it
    hands on to this one. It names what its commands depend on in `_state`.

    Attributes:
        frames: the tools of the channel and the joints that move them.
        targets: of the tools, as actions ask for them.
    """

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        tool: ToolNames = None,
        frame: FrameName = "base",
        command: CommandName = "pose",
        step_length: StepLength = 0.02,
        step_angle: StepAngle = 0.1,
        speed: Speed = 0.5,
        turn_rate: TurnRate = 1.5,
    ) -> None:
        super().__init__(channel, num_envs)
        self.frames = ToolFrames(channel, tool)
        self.targets = targets = ToolTargets(
            self.frames,
            num_envs,
            command=command,
            frame=frame,
            step_length=step_length,
            step_angle=step_angle,
            speed=speed,
            turn_rate=turn_rate,
        )
        self.dim, self.low, self.high, self.labels = targets.dim, targets.low, targets.high, targets.labels
        self._posture = np.zeros((num_envs, len(channel)))
        """(N, K) what the drives held at the reset: where joints go as far as tools leave them free."""
        self._state: dict[str, Array] = {}
        """(N, ...) each: what the next command depends on besides the targets, by its name in a snapshot."""

    @abstractmethod
    def _begin(self, env_ids: Array, targets: Array, poses: Array) -> None:
        """Drives of these envs hold `targets` (E, K) now, and tools `poses` (E, T, 7), base frame."""

    @abstractmethod
    def _follow(self, joint_pos: Array, target: Array, env_ids: Array | None) -> Command:
        """The commands that bring tools from joint positions (E, J) to targets (E, T, 7), base frame."""

    def _joint_pos(self, env_ids: Array | None) -> Array:
        """(E, J) joint positions from which steps and speeds move the targets: those measured."""
        return self.robot.joint_pos(env_ids)

    def reset(self, env_ids: Array, targets: Array) -> None:
        """Drives of these envs hold `targets` (E, K) now; so do tools."""
        poses = self.frames.poses(self.frames.whole(self.robot.joint_pos(env_ids), targets))
        self.targets.reset(env_ids, poses, self.robot.base_pose(env_ids))
        self._posture[env_ids] = targets
        self._begin(env_ids, targets, poses)

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        joint_pos = self._joint_pos(env_ids)
        poses = self.frames.poses(joint_pos) if self.targets.stepping else None
        target = self.targets.apply(action, env_ids, poses, self.robot.base_pose(env_ids))
        return self._follow(joint_pos, target, env_ids)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {**{name: values[env_ids] for name, values in self._state.items()}, **self.targets.snapshot(env_ids)}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        for name, values in self._state.items():
            values[env_ids] = data[name]
        self.targets.restore(env_ids, data)

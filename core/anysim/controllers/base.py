"""The contract of a controller: one channel, one slice of the action, commands for the channel's drives."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from anysim.controllers.robot import ControlledRobot
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.model.world import Channel, ControlMode, World

DEFAULT_CONTROLLER = "default"
"""In a world: the first of the controllers that the catalogue gives the channel."""


def columns(indices: Array) -> slice | Array:
    """What addresses these columns of an array: a slice where they are contiguous, for which nothing is copied."""
    contiguous = len(indices) > 0 and (np.diff(indices) == 1).all()
    return slice(int(indices[0]), int(indices[-1]) + 1) if contiguous else indices


class ChannelColumns(NamedTuple):
    """Columns of a channel's joints and drives among the world's, and the nominal home (K,) of the joints [rad, m]."""

    joints: slice | Array
    drives: slice | Array
    home: Array

    @classmethod
    def of(cls, world: World, channel: Channel) -> Self:
        """Those of a channel of a World."""
        joints, drives = np.array(channel.joints, dtype=int), np.array(channel.actuators, dtype=int)
        home = np.array([world.joints[j].initial for j in channel.joints], dtype=float)
        return cls(columns(joints), columns(drives), home)


@dataclass(frozen=True)
class ChannelView:
    """What a controller knows of its channel. Arrays have one entry for each drive (K,).

    `columns` is what `targets[:, columns]` needs to address the drives: a slice where they are contiguous.
    `joint_columns` are the channel's joints among the robot's J, as `ControlledRobot.joint_pos` has them.
    """

    name: str
    actuators: Array
    columns: slice | Array
    lower: Array
    upper: Array
    velocity_limit: Array
    effort_limit: Array
    kp: Array
    kd: Array
    opened: Array | None
    closed: Array | None
    robot: ControlledRobot
    joint_columns: Array

    @classmethod
    def of(cls, world: World, channel: Channel, robot: ControlledRobot) -> Self:
        """The view of a channel of a World."""
        drives = np.array(channel.actuators, dtype=int)
        actuators = [world.actuators[a] for a in channel.actuators]
        joints = [world.joints[a.joint] for a in actuators]
        ends = [
            None if v is None else np.array(v[: len(drives)], dtype=float) for v in (channel.opened, channel.closed)
        ]
        return cls(
            channel.name,
            drives,
            columns(drives),
            np.array([j.lower for j in joints]),
            np.array([j.upper for j in joints]),
            np.array([j.velocity_limit for j in joints]),
            np.array([a.effort_limit for a in actuators]),
            np.array([a.kp for a in actuators]),
            np.array([a.kd for a in actuators]),
            ends[0],
            ends[1],
            robot,
            np.array([a.joint for a in actuators], dtype=int) - (robot.joints[0] if len(robot.joints) else 0),
        )

    def __len__(self) -> int:
        """The number of drives K."""
        return len(self.actuators)

    def joint_pos(self, env_ids: Array | None) -> Array:
        """(E, K) measured [rad] or [m]."""
        return self.robot.joint_pos(env_ids)[:, self.joint_columns]

    def joint_vel(self, env_ids: Array | None) -> Array:
        """(E, K) measured [rad/s] or [m/s]."""
        return self.robot.joint_vel(env_ids)[:, self.joint_columns]


class Command(NamedTuple):
    """What a controller wants of its drives (E, K); None leaves what was commanded before.

    `position` [rad, m], `velocity` [rad/s, m/s] and `effort` [N m, N] (feed-forward) enter the drive law as the
    controller's `mode` says. `robot_effort` (E, D) is added to the feed-forward of all drives of the robot: for one
    that carries the whole body. It acts until the controller's next command.
    """

    position: Array | None = None
    velocity: Array | None = None
    effort: Array | None = None
    robot_effort: Array | None = None


class Controller(ABC):
    """Turns actions into commands of a channel. Keyword-only arguments of `__init__` are its YAML parameters.

    A parameter that belongs to the robot rather than to the user (the height of a gait, the radius of wheels) comes
    from the catalogue's `controllers`; give it the default None and raise a TaskError where it is None after all.

    Attributes:
        dim: the number of action components.
        low, high: their bounds (dim,).
        labels: names of the components, for people; empty for the names of the channel's joints.
        mode: which terms of the drive law act; the same for all drives of the channel, or one each.
        period: [s] between calls of `update`; None for one `apply` each control step and nothing between.
        delay: [s] after which what it is told is done; who plans ahead begins where the robot is then.
    """

    dim: int
    low: Array
    high: Array
    labels: tuple[str, ...] = ()
    mode: ControlMode | tuple[ControlMode, ...] = ControlMode.POSITION
    period: float | None = None
    delay: float = 0.0

    def __init__(self, channel: ChannelView, num_envs: int) -> None:
        self.channel = channel
        self.robot = channel.robot
        self.num_envs = num_envs

    def reset(self, env_ids: Array, targets: Array) -> None:
        """The drives of these envs hold `targets` (E, K) now. `self.robot` shows the state after the reset."""

    @abstractmethod
    def apply(self, action: Array, env_ids: Array | None) -> Command:
        """Commands for actions (E, dim) of all envs, or of `env_ids`; called once each control step."""

    def update(self, env_ids: Array | None) -> Command:
        """Commands between two control steps, every `period` after `apply`, for the action given there."""
        return Command()

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        """The action (E, dim), within its bounds, that brings the drives nearest to targets (E, K) in one step.

        Raises:
            TaskError: this controller is not asked for joint positions.
        """
        raise TaskError(
            f"{type(self).__name__} of '{self.robot.name}.{self.channel.name}' takes no joint positions; "
            "give the channel joint_position or joint_delta_position"
        )

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of the controller's own state."""
        return {}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned."""

"""`IkController`: drives follow a joint configuration that inverse kinematics leads after the targets of tools.

The reference is a joint configuration that only the solver moves; drives follow it. It starts where the drives are
asked to be, so an arm that sags under a load does not creep, and what is asked for can be reached exactly.
"""

from abc import abstractmethod
from typing import Annotated, Literal, Unpack

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command
from anysim.conventions import Array
from anysim_control.tools.controller import ToolController, ToolOptions
from anysim_control.tools.link_effort import CarryWeight, LinkEffort

FeedForward = Annotated[
    Literal["none", "velocity", "effort"],
    Field(
        description="velocity: without it a moving tool lags by kd / kp times its speed; effort: that, and what "
        "accelerates the links and carries them, without which a tool leaves its path where that bends"
    ),
]
VelocityScale = Annotated[float, Field(gt=0, le=1, description="the part of the joints' velocity limits that is used")]

MAX_ACCELERATION = 30.0
"""[rad/s^2], [m/s^2] beyond which the change of a reference is a jump, not a motion."""


class IkOptions(ToolOptions, total=False):
    """The keyword-only parameters of `IkController`, for subclasses that hand them on."""

    velocity_scale: VelocityScale
    feed_forward: FeedForward
    carry_weight: CarryWeight


class IkController(ToolController):
    """Keeps the reference, asks the subclass to move it, and commands position and velocity.

    A drive lags behind a moving target by kd / kp times its speed, so the velocity is commanded too. During a control
    step drives see one constant position; halfway between the reference before and after the step is the one that a
    steady motion is at on average, so a moving tool is where the action says at the end of the step, neither early nor
    late, and at rest the reference is held exactly. Efforts for the acceleration are bounded: a jump of a target
    asks for one that no arm has.

    Attributes:
        max_step: (K,) [rad] or [m] the most a reference moves in a control step.
    """

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        velocity_scale: VelocityScale = 1.0,
        feed_forward: FeedForward = "effort",
        carry_weight: CarryWeight = None,
        **options: Unpack[ToolOptions],
    ) -> None:
        super().__init__(channel, num_envs, **options)
        self.max_step = velocity_scale * channel.velocity_limit * self.robot.control_dt
        self._feed_forward, self._links = feed_forward, LinkEffort(self.robot, carry_weight)
        self._reference = np.zeros((num_envs, len(channel)))
        self._rate = np.zeros((num_envs, len(channel)))
        """(N, K) the velocity last commanded."""
        self._state = {"reference": self._reference, "posture": self._posture, "rate": self._rate}

    @abstractmethod
    def solve(self, joint_pos: Array, targets: Array, posture: Array) -> Array:
        """Where the channel's joints (E, K) are to be a control step later; row i depends on row i alone.

        Args:
            joint_pos: (E, J) the reference for the channel and its followers, what is measured for the others.
            targets: (E, T, 7) of the tools, base frame.
            posture: (E, K) where drives were at the reset.
        """

    def reset(self, env_ids: Array, targets: Array) -> None:
        super().reset(env_ids, np.clip(targets, self.channel.lower, self.channel.upper))

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        """The action that brings the tools nearest to where they are at joint targets (E, K)."""
        poses = self.frames.poses(self.frames.whole(self.robot.joint_pos(env_ids), targets))
        return self.targets.action_for(poses, env_ids, self.robot.base_pose(env_ids))

    def _begin(self, env_ids: Array, targets: Array, poses: Array) -> None:
        self._reference[env_ids], self._rate[env_ids] = targets, 0.0

    def _joint_pos(self, env_ids: Array | None) -> Array:
        rows = slice(None) if env_ids is None else env_ids
        return self.frames.whole(self.robot.joint_pos(env_ids), self._reference[rows])

    def _follow(self, joint_pos: Array, target: Array, env_ids: Array | None) -> Command:
        rows = slice(None) if env_ids is None else env_ids
        before, old = np.array(self._reference[rows]), np.array(self._rate[rows])
        solved = self.solve(joint_pos, target, self._posture[rows])
        after = np.clip(solved, self.channel.lower, self.channel.upper)
        rate = (after - before) / self.robot.control_dt
        self._reference[rows], self._rate[rows] = after, rate
        if self._feed_forward == "none":
            return Command(position=after)
        position = 0.5 * (before + after)
        if self._feed_forward == "velocity":
            return Command(position, rate)
        return Command(position, rate, self._effort(joint_pos, position, rate, old, self.robot.base_pose(env_ids)))

    def _effort(self, joint_pos: Array, position: Array, rate: Array, old: Array, base: Array) -> Array:
        spread = self.frames.spread
        change = np.clip((rate - old) / self.robot.control_dt, -MAX_ACCELERATION, MAX_ACCELERATION)
        joint_pos = self.frames.whole(joint_pos, position)
        return np.array(
            [
                spread.T @ self._links.of(joint_pos[i], spread @ rate[i], spread @ change[i], base[i])
                for i in range(len(position))
            ]
        ).reshape(position.shape)

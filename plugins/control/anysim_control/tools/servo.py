"""Commands of drives that follow targets of tools: the part that all inverse kinematics controllers share.

The reference is a joint configuration that only the solver moves; drives follow it. It starts where the drives are
asked to be, so an arm that sags under a load does not creep, and what is asked for can be reached exactly.
"""

from collections.abc import Callable, Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command
from anysim.conventions import Array
from anysim_control.tools.frames import ToolFrames
from anysim_control.tools.link_effort import LinkEffort
from anysim_control.tools.target import ToolTargets

FeedForward = Annotated[
    Literal["none", "velocity", "effort"],
    Field(
        description="velocity: without it a moving tool lags by kd / kp times its speed; effort: that, and what "
        "accelerates the links and carries them, without which a tool leaves its way where that bends"
    ),
]
VelocityScale = Annotated[float, Field(gt=0, le=1, description="the part of the joints' velocity limits that is used")]

MAX_ACCELERATION = 30.0
"""[rad/s^2], [m/s^2] beyond which the change of a reference is a jump, not a motion."""

Solve = Callable[[Array, Array, Array], Array]
"""(joint_pos (E, J), targets (E, T, 7) in the base frame, posture (E, K)) -> (E, K) where the channel's joints are to
be a control step later. `joint_pos` holds the reference for the channel and its followers and what is measured for the
others; `posture` is where drives were at the reset. Row i of the answer depends on row i of the question alone."""


class ToolServo:
    """Keeps the reference, asks the solver, and commands position and velocity.

    A drive lags behind a moving target by kd / kp times its speed, so the velocity is commanded too. During a control
    step drives see one constant position; halfway between the reference before and after the step is the one that a
    steady motion is at on average, so a moving tool is where the action says at the end of the step, neither early nor
    late, and at rest the reference is held exactly. Efforts for the acceleration are bounded: a jump of a target
    asks for one that no arm has.
    """

    def __init__(
        self,
        frames: ToolFrames,
        targets: ToolTargets,
        solve: Solve,
        num_envs: int,
        *,
        feed_forward: str,
        velocity_scale: float,
        carry_weight: bool | None,
    ) -> None:
        self._frames, self._targets, self._solve = frames, targets, solve
        self._channel: ChannelView = frames.channel
        self._feed_forward, self._links = feed_forward, LinkEffort(frames.robot, carry_weight)
        self.max_step = velocity_scale * self._channel.velocity_limit * frames.robot.control_dt
        """(K,) [rad] or [m] the most a reference moves in a control step."""
        self._reference = np.zeros((num_envs, len(self._channel)))
        self._rate = np.zeros((num_envs, len(self._channel)))
        """(N, K) the velocity last commanded."""
        self._posture = np.zeros((num_envs, len(self._channel)))

    def reset(self, env_ids: Array, targets: Array) -> None:
        """Drives of these envs hold `targets` (E, K) now; so do tools."""
        self._reference[env_ids] = np.clip(targets, self._channel.lower, self._channel.upper)
        self._posture[env_ids], self._rate[env_ids] = self._reference[env_ids], 0.0
        joint_pos = self._frames.whole(self._frames.robot.joint_pos(env_ids), self._reference[env_ids])
        self._targets.reset(env_ids, self._frames.poses(joint_pos), self._frames.robot.base_pose(env_ids))

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        """Commands for actions (E, dim)."""
        rows = slice(None) if env_ids is None else env_ids
        robot, channel = self._frames.robot, self._channel
        before = np.array(self._reference[rows])
        joint_pos = self._frames.whole(robot.joint_pos(env_ids), before)
        poses = self._frames.poses(joint_pos) if self._targets.stepping else None
        target = self._targets.apply(action, env_ids, poses, robot.base_pose(env_ids))
        after = np.clip(self._solve(joint_pos, target, self._posture[rows]), channel.lower, channel.upper)
        self._reference[rows] = after
        rate, old = (after - before) / robot.control_dt, np.array(self._rate[rows])
        self._rate[rows] = rate
        if self._feed_forward == "none":
            return Command(position=after)
        position = 0.5 * (before + after)
        if self._feed_forward == "velocity":
            return Command(position, rate)
        return Command(position, rate, self._effort(joint_pos, position, rate, old, robot.base_pose(env_ids)))

    def _effort(self, joint_pos: Array, position: Array, rate: Array, old: Array, base: Array) -> Array:
        spread = self._frames.spread
        change = np.clip((rate - old) / self._frames.robot.control_dt, -MAX_ACCELERATION, MAX_ACCELERATION)
        joint_pos = self._frames.whole(joint_pos, position)
        return np.array(
            [
                spread.T @ self._links.of(joint_pos[i], spread @ rate[i], spread @ change[i], base[i])
                for i in range(len(position))
            ]
        ).reshape(position.shape)

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        """The action that brings the tools nearest to where they are at joint targets (E, K)."""
        robot = self._frames.robot
        joint_pos = self._frames.whole(robot.joint_pos(env_ids), targets)
        return self._targets.action_for(self._frames.poses(joint_pos), env_ids, robot.base_pose(env_ids))

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of the reference and the targets."""
        return {
            "reference": self._reference[env_ids],
            "posture": self._posture[env_ids],
            "rate": self._rate[env_ids],
            **self._targets.snapshot(env_ids),
        }

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned."""
        self._reference[env_ids], self._posture[env_ids] = data["reference"], data["posture"]
        self._rate[env_ids] = data["rate"]
        self._targets.restore(env_ids, data)

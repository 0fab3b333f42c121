"""`differential_ik`: tools follow targets by damped least squares on the Jacobians of all of them at once."""

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim_control.tools.damped import damped_step, shortened
from anysim_control.tools.frames import ToolFrames
from anysim_control.tools.link_effort import CarryWeight
from anysim_control.tools.servo import FeedForward, ToolServo, VelocityScale
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


class DifferentialIk(Controller):
    """Damped least squares; what the tools leave free pulls the joints to the posture they had at the reset."""

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
        velocity_scale: VelocityScale = 1.0,
        feed_forward: FeedForward = "effort",
        carry_weight: CarryWeight = None,
        damping: Annotated[float, Field(gt=0, description="[m/rad] larger is calmer near singularities")] = 0.02,
        posture_gain: Annotated[
            float, Field(ge=0, le=1, description="the part of the way to the posture asked for in a control step")
        ] = 0.02,
        iterations: Annotated[int, Field(ge=1, le=20, description="linearisations in a control step")] = 2,
    ) -> None:
        super().__init__(channel, num_envs)
        self._frames = ToolFrames(channel, tool)
        targets = ToolTargets(
            self._frames,
            num_envs,
            command=command,
            frame=frame,
            step_length=step_length,
            step_angle=step_angle,
            speed=speed,
            turn_rate=turn_rate,
        )
        self._axes = 6 if targets.oriented else 3
        self._servo = ToolServo(
            self._frames,
            targets,
            self._solve,
            num_envs,
            feed_forward=feed_forward,
            velocity_scale=velocity_scale,
            carry_weight=carry_weight,
        )
        self.dim, self.low, self.high, self.labels = targets.dim, targets.low, targets.high, targets.labels
        self._damping, self._gain, self._iterations = damping, posture_gain, iterations

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._servo.reset(env_ids, targets)

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        return self._servo.apply(action, env_ids)

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        return self._servo.action_for(targets, env_ids)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return self._servo.snapshot(env_ids)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._servo.restore(env_ids, data)

    def _solve(self, joint_pos: Array, targets: Array, posture: Array) -> Array:
        answer = np.empty((len(joint_pos), len(self.channel)))
        for row, (position, target) in enumerate(zip(joint_pos, targets, strict=True)):
            answer[row] = self._solve_one(position, target, posture[row])
        return answer

    def _solve_one(self, position: Array, target: Array, posture: Array) -> Array:
        columns, spread = self.channel.joint_columns, self._frames.spread
        start = position[columns]
        position, now = np.array(position), start
        for _ in range(self._iterations):
            places, jacobian = self._frames.poses_and_jacobians(position)
            error = self._frames.errors(places, target)[:, : self._axes].reshape(-1)
            flat = jacobian[:, : self._axes].reshape(len(error), -1)
            move = damped_step(
                flat,
                error,
                self._gain / self._iterations * (posture - now),
                self.channel.lower - now,
                self.channel.upper - now,
                self._damping,
            )
            position = position + spread @ move
            now = now + move
        return start + shortened(now - start, self._servo.max_step)

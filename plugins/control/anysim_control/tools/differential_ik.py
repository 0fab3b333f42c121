"""`differential_ik`: tools follow targets by damped least squares on the Jacobians of all of them at once."""

from typing import Annotated, Unpack

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView
from anysim.conventions import Array
from anysim_control.tools.damped import damped_step, shortened
from anysim_control.tools.ik_controller import IkController, IkOptions


class DifferentialIk(IkController):
    """Damped least squares; what the tools leave free pulls the joints to the posture they had at the reset."""

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        damping: Annotated[float, Field(gt=0, description="[m/rad] larger is calmer near singularities")] = 0.02,
        posture_gain: Annotated[
            float, Field(ge=0, le=1, description="the part of the distance to the posture asked for in a control step")
        ] = 0.02,
        iterations: Annotated[int, Field(ge=1, le=20, description="linearisations in a control step")] = 2,
        **options: Unpack[IkOptions],
    ) -> None:
        super().__init__(channel, num_envs, **options)
        self._axes = 6 if self.targets.oriented else 3
        self._damping, self._gain, self._iterations = damping, posture_gain, iterations

    def solve(self, joint_pos: Array, targets: Array, posture: Array) -> Array:
        answer = np.empty((len(joint_pos), len(self.channel)))
        for row, (position, target) in enumerate(zip(joint_pos, targets, strict=True)):
            answer[row] = self._solve_one(position, target, posture[row])
        return answer

    def _solve_one(self, position: Array, target: Array, posture: Array) -> Array:
        columns, spread = self.channel.joint_columns, self.frames.spread
        start = position[columns]
        position, now = np.array(position), start
        for _ in range(self._iterations):
            places, jacobian = self.frames.poses_and_jacobians(position)
            error = self.frames.errors(places, target)[:, : self._axes].reshape(-1)
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
        return start + shortened(now - start, self.max_step)

"""A controller of joint positions that limits their speed."""

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array


class EasedPosition(Controller):
    """The action is a joint position [rad, m]; the drives are led there no faster than a share of their limits."""

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        share: Annotated[float, Field(gt=0, le=1, description="of the joints' velocity limits")] = 0.5,
    ) -> None:
        super().__init__(channel, num_envs)
        self.dim = len(channel)
        self.low, self.high = channel.lower, channel.upper
        self._stride = share * channel.velocity_limit * channel.robot.world.physics.control_dt
        self._target = np.zeros((num_envs, self.dim))

    def reset(self, env_ids: Array, targets: Array) -> None:
        """Begin at what the drives hold."""
        self._target[env_ids] = targets

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        """One stride towards the action (E, dim)."""
        rows = slice(None) if env_ids is None else env_ids
        self._target[rows] += np.clip(action - self._target[rows], -self._stride, self._stride)
        return Command(position=self._target[rows])

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        """The action that leads to targets (E, dim): the targets, within the limits."""
        return np.clip(targets, self.low, self.high)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """What the next command depends on."""
        return {"target": self._target[env_ids]}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Go on from a snapshot."""
        self._target[env_ids] = data["target"]

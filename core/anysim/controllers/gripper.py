"""Grippers."""

import numpy as np

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim.errors import TaskError


class GripperBinary(Controller):
    """One number opens (>= 0) or closes (< 0) the gripper: its drives go to the channel's `opened` or `closed` targets.

    The closed target lies beyond contact, so that the drives press with their effort limit.
    """

    labels = ("open",)

    def __init__(self, channel: ChannelView, num_envs: int) -> None:
        super().__init__(channel, num_envs)
        if channel.opened is None or channel.closed is None:
            raise TaskError(
                f"channel '{channel.name}' has no `opened` and `closed` targets in the catalogue, which gripper_binary "
                "needs; add them to the robot's entry or choose another controller"
            )
        self._opened, self._closed = channel.opened, channel.closed
        self.dim = 1
        self.low, self.high = -np.ones(1), np.ones(1)

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        return Command(position=np.where(action >= 0, self._opened, self._closed))

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        nearer_open = np.abs(targets - self._opened).sum(axis=1) <= np.abs(targets - self._closed).sum(axis=1)
        return np.where(nearer_open, 1.0, -1.0)[:, None]

"""Grippers."""

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

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
        self._opened, self._closed = _ends(channel, "gripper_binary")
        self.dim = 1
        self.low, self.high = -np.ones(1), np.ones(1)

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        return Command(position=np.where(action >= 0, self._opened, self._closed))

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        nearer_open = np.abs(targets - self._opened).sum(axis=1) <= np.abs(targets - self._closed).sum(axis=1)
        return np.where(nearer_open, 1.0, -1.0)[:, None]


class GripperContinuous(Controller):
    """One number says how far the gripper is open; the lowest one closes it with all its force.

    In between the drives are asked for that opening and press, where something is in the way, as hard as the distance
    makes them (kp) and never harder than their effort limit. With a `speed` the targets move there at that speed and
    never lead the fingers by more than what the effort limit can make of it, so that they do not have to come back
    from far inside of what they hold.
    """

    labels = ("opening",)

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        range: Annotated[tuple[float, float], Field(description="the action of the closed and of the open gripper")] = (
            0.0,
            1.0,
        ),
        speed: Annotated[
            float | None, Field(gt=0, description="[1/s] of the whole stroke; the drives' own where not given")
        ] = None,
    ) -> None:
        super().__init__(channel, num_envs)
        self._opened, self._closed = _ends(channel, "gripper_continuous")
        if not range[0] < range[1]:
            raise TaskError(
                f"gripper_continuous of '{channel.name}': the range {list(range)} has to rise, as [0, 1] does"
            )
        self.dim = 1
        self.low, self.high = np.array([range[0]], dtype=float), np.array([range[1]], dtype=float)
        self._shut = np.minimum(np.maximum(self._closed, channel.lower), channel.upper)
        self._stroke = self._opened - self._shut
        stroke = np.abs(self._stroke)
        self._step = None if speed is None else np.where(stroke > 0, speed * channel.robot.control_dt * stroke, np.inf)
        with np.errstate(divide="ignore"):
            self._lead = np.where(channel.kp > 0, channel.effort_limit / channel.kp, np.inf)
        self._target = np.zeros((num_envs, len(channel)))

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._target[env_ids] = targets

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        rows = slice(None) if env_ids is None else env_ids
        share = (action - self.low) / (self.high - self.low)
        goal = np.where(share > 0, self._shut + share * self._stroke, self._closed)
        if self._step is not None:
            here, was = self.channel.joint_pos(env_ids), self._target[rows]
            goal = was + np.minimum(np.maximum(goal - was, -self._step), self._step)
            goal = np.minimum(np.maximum(goal, here - self._lead), here + self._lead)
        self._target[rows] = goal
        return Command(position=goal)

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        moves = self._stroke != 0
        share = ((targets - self._shut)[:, moves] / self._stroke[moves]).sum(axis=1) / max(int(moves.sum()), 1)
        return (self.low + np.minimum(np.maximum(share, 0.0), 1.0) * (self.high - self.low))[:, None]

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {"target": self._target[env_ids]}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._target[env_ids] = data["target"]


def _ends(channel: ChannelView, controller: str) -> tuple[Array, Array]:
    """The channel's `opened` and `closed`."""
    if channel.opened is None or channel.closed is None:
        raise TaskError(
            f"channel '{channel.name}' has no `opened` and `closed` targets in the catalogue, which {controller} "
            "needs; add them to the robot's entry or choose another controller"
        )
    return channel.opened, channel.closed

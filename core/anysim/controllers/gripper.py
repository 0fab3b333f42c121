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


class GripperForce(GripperBinary):
    """One number opens (>= 0) or closes (< 0) the gripper, which then presses with that share of its effort limit.

    The target is as far beyond the fingers as makes their drives press so hard (kp), and further by what their damping
    takes, so that they close as fast with a little force as with all of it. That holds for as long as they move on: as
    they have in the control step before, and do in this physics step. So it ends at contact, and none comes of chatter.
    """

    def __init__(self, channel: ChannelView, num_envs: int) -> None:
        super().__init__(channel, num_envs)
        if not (channel.kp > 0).all() or not np.isfinite(channel.effort_limit).all():
            raise TaskError(
                f"the drives of '{channel.name}' have no stiffness, or no effort limit of which gripper_force takes a "
                "share; give them `kp` and `effort_limit` in the robot's entry, or use gripper_binary"
            )
        self.period = channel.robot.dt
        self._way = np.sign(self._closed - self._opened)
        self._action = np.zeros((num_envs, 1))
        self._place, self._speed = np.zeros((2, num_envs, len(channel)))
        """(N, K) where the joints were at the last action, and how fast they had closed since the one before."""

    def reset(self, env_ids: Array, targets: Array) -> None:
        del targets
        self._action[env_ids], self._speed[env_ids] = 0.0, 0.0
        self._place[env_ids] = self.channel.joint_pos(env_ids)

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        rows, here = slice(None) if env_ids is None else env_ids, self.channel.joint_pos(env_ids)
        self._action[rows] = action
        self._speed[rows] = (here - self._place[rows]) * self._way / self.channel.robot.control_dt
        self._place[rows] = here
        return self.update(env_ids)

    def update(self, env_ids: Array | None) -> Command:
        channel, rows = self.channel, slice(None) if env_ids is None else env_ids
        action, now = self._action[rows], channel.joint_vel(env_ids) * self._way
        force = np.minimum(np.maximum(-action, 0.0), 1.0) * channel.effort_limit
        damped = channel.kd * np.maximum(np.minimum(self._speed[rows], now), 0.0)
        beyond = np.minimum(force + damped, channel.effort_limit) / channel.kp
        pressing = np.where(action > -1.0, channel.joint_pos(env_ids) + self._way * beyond, self._closed)
        return Command(position=np.where(action >= 0, self._opened, pressing))

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {"action": self._action[env_ids], "place": self._place[env_ids], "speed": self._speed[env_ids]}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._action[env_ids] = data["action"]
        self._place[env_ids], self._speed[env_ids] = data["place"], data["speed"]


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

"""Control of joints by position, change of position, velocity or effort."""

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.model.world import ControlMode


class JointPosition(Controller):
    """The action is the joint position target itself [rad, m], bounded by the joint limits."""

    def __init__(self, channel: ChannelView, num_envs: int) -> None:
        super().__init__(channel, num_envs)
        self.dim = len(channel.actuators)
        self.low, self.high = channel.lower, channel.upper

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        return Command(position=action)

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        return np.minimum(np.maximum(targets, self.low), self.high)


class JointDeltaPosition(Controller):
    """The action moves the joint position targets: target += scale * action, action in [-1, 1], inside the limits.

    It moves the target, not the measured position, so that a load does not make the arm sag away.
    """

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        scale: Annotated[float, Field(gt=0, description="largest change in one control step [rad, m]")] = 0.05,
    ) -> None:
        super().__init__(channel, num_envs)
        self.dim = len(channel.actuators)
        self.low, self.high = -np.ones(self.dim), np.ones(self.dim)
        self.scale = scale
        self._target = np.zeros((num_envs, self.dim))

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._target[env_ids] = targets

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        moved = self.scale * action
        moved += self._target if env_ids is None else self._target[env_ids]
        np.maximum(moved, self.channel.lower, out=moved)
        np.minimum(moved, self.channel.upper, out=moved)
        self._target[slice(None) if env_ids is None else env_ids] = moved
        return Command(position=moved)

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        wanted = (targets - self._target[env_ids]) / self.scale
        return np.minimum(np.maximum(wanted, self.low), self.high)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {"target": self._target[env_ids]}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._target[env_ids] = data["target"]


class JointVelocity(Controller):
    """The action is the joint velocity target itself [rad/s, m/s]: the drives exert kd (qd* - qd), clipped.

    The drives have no position to hold, so what a load takes from them is not made up for.
    """

    mode = ControlMode.VELOCITY

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        limit: Annotated[
            float | None, Field(gt=0, description="largest velocity [rad/s, m/s]; the joints' own where not given")
        ] = None,
    ) -> None:
        super().__init__(channel, num_envs)
        self.dim = len(channel)
        self.high = _bounds(channel, channel.velocity_limit, limit, "velocity")
        self.low = -self.high
        lost = np.flatnonzero(channel.kd <= 0)
        if len(lost):
            raise TaskError(
                f"the drives of '{channel.robot.name}.{channel.name}' have no damping kd, by which velocities are "
                "followed; give the channel's gains a kd"
            )

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        return Command(velocity=action)


class JointEffort(Controller):
    """The action is the effort of each drive itself [N m, N], within the effort limits."""

    mode = ControlMode.EFFORT

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        limit: Annotated[
            float | None, Field(gt=0, description="largest effort [N m, N]; the drives' own where not given")
        ] = None,
    ) -> None:
        super().__init__(channel, num_envs)
        self.dim = len(channel)
        self.high = _bounds(channel, channel.effort_limit, limit, "effort")
        self.low = -self.high

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        return Command(effort=action)


def _bounds(channel: ChannelView, own: Array, limit: float | None, what: str) -> Array:
    bounds = own if limit is None else np.minimum(own, limit)
    if not np.isfinite(bounds).all():
        raise TaskError(
            f"'{channel.robot.name}.{channel.name}' has joints without a limit of {what}, so the action has no bounds; "
            "give the parameter `limit`"
        )
    return bounds.astype(float)

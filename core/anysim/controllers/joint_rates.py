"""Joint velocity and joint effort control."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.model.world import ControlMode


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

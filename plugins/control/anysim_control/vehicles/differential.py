"""Driving a base with two wheels on one axle."""

from collections.abc import Mapping

import numpy as np

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim_control.vehicles.parts import Drives, Ramp, bound, vehicle_of
from anysim_control.vehicles.wheels import differential_wheels, within_limits
from anysim_schemas.base import Positive
from anysim_schemas.vehicle import DifferentialSpec


class DifferentialDrive(Controller):
    """The action is the base's velocity: forward [m/s] and to the left [rad/s].

    Where the wheels are too slow for both, both shrink by one factor, so that the path keeps its curvature.

    Args:
        max_speed: largest speed in the action [m/s]; that of the wheels where not given.
        max_turn: largest rate in the action [rad/s]; that of the wheels where not given.
        acceleration: [m/s^2].
        turn_acceleration: [rad/s^2].

    Raises:
        TaskError: the robot is no differential vehicle, or nothing bounds the action.
    """

    labels = ("speed", "turn")

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        max_speed: Positive | None = None,
        max_turn: Positive | None = None,
        acceleration: Positive = 1.0,
        turn_acceleration: Positive = 3.0,
    ) -> None:
        super().__init__(channel, num_envs)
        self._vehicle = vehicle_of(channel, DifferentialSpec, "differential_drive")
        self._drives = Drives(channel, num_envs, (), (self._vehicle.left, self._vehicle.right))
        self.mode = self._drives.modes
        self._limits = channel.velocity_limit[self._drives.wheels]
        most, name = float(self._limits.min()) * self._vehicle.wheel_radius, channel.robot.name
        self.dim = 2
        self.high = np.array(
            [
                bound(max_speed, most, "max_speed", name),
                bound(max_turn, 2 * most / self._vehicle.track, "max_turn", name),
            ]
        )
        self.low = -self.high
        self._ramp = Ramp(num_envs, (acceleration, turn_acceleration), self.robot.control_dt)

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._drives.reset(env_ids, targets)
        self._ramp.reset(env_ids)

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        wanted = np.minimum(np.maximum(action, self.low), self.high)
        wanted = wanted * within_limits(self._wheels(wanted), self._limits)[:, None]
        wheels = self._wheels(self._ramp.toward(wanted, env_ids))
        return Command(self._drives.positions(env_ids), self._drives.velocities(env_ids, wheels))

    def _wheels(self, command: Array) -> Array:
        return differential_wheels(command[:, 0], command[:, 1], self._vehicle.wheel_radius, self._vehicle.track)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {"now": self._ramp.now[env_ids], **self._drives.snapshot(env_ids)}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._ramp.now[env_ids] = data["now"]
        self._drives.restore(env_ids, data)

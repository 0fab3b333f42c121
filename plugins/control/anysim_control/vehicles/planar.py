"""Driving a base that has joints over a plane in place of wheels."""

from collections.abc import Mapping

import numpy as np

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim_control.vehicles.parts import Drives, Ramp, vehicle_of
from anysim_control.vehicles.wheels import turned_twist
from anysim_schemas.base import Positive
from anysim_schemas.vehicle import PlanarSpec


class PlanarDrive(Controller):
    """The action is the base's velocity in its own axes: forward and to the left [m/s], and turning left [rad/s].

    Args:
        max_speed: largest speed along either axis [m/s].
        max_turn: largest rate [rad/s].
        acceleration: along each axis [m/s^2].
        turn_acceleration: [rad/s^2].

    Raises:
        TaskError: the robot has no planar vehicle.
    """

    labels = ("forward", "left", "turn")

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        max_speed: Positive = 1.0,
        max_turn: Positive = 2.0,
        acceleration: Positive = 1.0,
        turn_acceleration: Positive = 3.0,
    ) -> None:
        super().__init__(channel, num_envs)
        vehicle = vehicle_of(channel, PlanarSpec, "planar_drive")
        self._drives = Drives(channel, num_envs, (), (vehicle.x, vehicle.y, vehicle.yaw))
        self.mode = self._drives.modes
        self.dim = 3
        self.high = np.array([max_speed, max_speed, max_turn])
        self.low = -self.high
        self._ramp = Ramp(num_envs, (acceleration, acceleration, turn_acceleration), self.robot.control_dt)

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._drives.reset(env_ids, targets)
        self._ramp.reset(env_ids)

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        twist = self._ramp.toward(np.minimum(np.maximum(action, self.low), self.high), env_ids)
        yaw = self.channel.joint_pos(env_ids)[:, self._drives.wheels[2]]
        # the heading amid the control step: with that at its beginning a circle would open into a spiral
        moved = turned_twist(twist, yaw + 0.5 * self.robot.control_dt * twist[:, 2])
        return Command(self._drives.positions(env_ids), self._drives.velocities(env_ids, moved))

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {"now": self._ramp.now[env_ids], **self._drives.snapshot(env_ids)}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._ramp.now[env_ids] = data["now"]
        self._drives.restore(env_ids, data)

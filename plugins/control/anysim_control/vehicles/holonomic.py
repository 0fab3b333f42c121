"""Driving a base on wheels that are each steered."""

from collections.abc import Mapping

import numpy as np

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim_control.vehicles.parts import Drives, Ramp, bound, rows_of, vehicle_of
from anysim_control.vehicles.wheels import shortest_turn, swerve_modules, within_limits
from anysim_schemas.base import Positive
from anysim_schemas.vehicle import SwerveSpec

_STANDING = 1e-5  # [m/s] below which a wheel keeps its angle


class HolonomicDrive(Controller):
    """The action is the base's velocity in its own axes: forward and to the left [m/s], and turning left [rad/s].

    Each wheel steers by the shorter way and may roll backwards. While wheels are turning to a new direction all of them
    slow down together, to a stop where one stands across; so a base that is to leave at a right angle steers first.
    Where wheels are too slow, the velocity shrinks as a whole.

    Args:
        max_speed: largest speed along either axis in the action [m/s]; that of the wheels where not given.
        max_turn: largest rate in the action [rad/s]; that of the wheels where not given.
        acceleration: along each axis [m/s^2].
        turn_acceleration: [rad/s^2].

    Raises:
        TaskError: the robot has no steered wheels, or nothing bounds the action.
    """

    labels = ("forward", "left", "turn")

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
        modules = vehicle_of(channel, SwerveSpec, "holonomic_drive").modules
        self._drives = Drives(channel, num_envs, [m.steer for m in modules], [m.wheel for m in modules])
        self.mode = self._drives.modes
        self._positions = np.array([m.position for m in modules])
        self._radii = np.array([m.radius for m in modules])
        # in metres a second, so that wheels of several sizes compare
        self._limits = channel.velocity_limit[self._drives.wheels] * self._radii
        most, name = float(self._limits.min()), channel.robot.name
        reach = float(np.hypot(*self._positions.T).max())
        speed = bound(max_speed, most, "max_speed", name)
        self.dim = 3
        self.high = np.array([speed, speed, bound(max_turn, most / reach, "max_turn", name)])
        self.low = -self.high
        self._ramp = Ramp(num_envs, (acceleration, acceleration, turn_acceleration), self.robot.control_dt)
        self._angles = np.zeros((num_envs, len(modules)))

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._drives.reset(env_ids, targets)
        self._ramp.reset(env_ids)
        self._angles[env_ids] = targets[:, self._drives.steered]

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        rows = rows_of(env_ids)
        wanted = np.minimum(np.maximum(action, self.low), self.high)
        _, speeds = swerve_modules(wanted, self._positions)
        twist = self._ramp.toward(wanted * within_limits(speeds, self._limits)[:, None], env_ids)
        angles, speeds = swerve_modules(twist, self._positions)
        measured = self.channel.joint_pos(env_ids)[:, self._drives.steered]
        angles, speeds = shortest_turn(angles, speeds, measured)
        angles = np.where(np.abs(speeds) > _STANDING, angles, self._angles[rows])
        self._angles[rows] = angles
        aligned = np.maximum(np.cos(angles - measured), 0.0).min(axis=1)
        wheels = speeds * (aligned**2)[:, None] / self._radii
        return Command(self._drives.positions(env_ids, angles), self._drives.velocities(env_ids, wheels))

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {"now": self._ramp.now[env_ids], "angles": self._angles[env_ids], **self._drives.snapshot(env_ids)}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._ramp.now[env_ids], self._angles[env_ids] = data["now"], data["angles"]
        self._drives.restore(env_ids, data)

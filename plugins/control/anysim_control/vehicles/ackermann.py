"""Driving a car."""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim_control.vehicles.parts import Drives, Ramp, bound, rows_of, vehicle_of
from anysim_control.vehicles.wheels import (
    ackermann_steering,
    ackermann_wheels,
    curvature_of,
    steering_of,
    within_limits,
)
from anysim_schemas.base import Positive
from anysim_schemas.vehicle import AckermannSpec, rear_and_front

_STANDING = 1e-6  # [m/s] below which a rate of turning says nothing about the wheels


class AckermannDrive(Controller):
    """The action is the speed of the rear axle [m/s], and the steering [rad] or the rate of turning [rad/s].

    The steering is the angle of a wheel in the middle of the front axle, positive to the left; the two front wheels
    stand about one centre. A rate of turning is had as far as the curvature's limit allows; a car that stands keeps its
    steering. Where the wheels are too slow, the speed shrinks and the curvature stays.

    Args:
        steer_by: whether the second component is the `angle` or the `rate` of turning.
        max_speed: largest speed in the action [m/s]; that of the wheels where not given.
        acceleration: [m/s^2].
        steering_rate: how fast the angle changes [rad/s].

    Raises:
        TaskError: the robot is no car, or nothing bounds the action.
    """

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        steer_by: Literal["angle", "rate"] = "angle",
        max_speed: Positive | None = None,
        acceleration: Positive = 1.0,
        steering_rate: Positive = 2.0,
    ) -> None:
        super().__init__(channel, num_envs)
        self._vehicle = v = vehicle_of(channel, AckermannSpec, "ackermann_drive")
        driven = rear_and_front(v)
        self._drives = Drives(channel, num_envs, (v.steering_left, v.steering_right), driven)
        self.mode = self._drives.modes
        self._limits = channel.velocity_limit[self._drives.wheels]
        speed = bound(max_speed, float(self._limits.min()) * v.wheel_radius, "max_speed", channel.robot.name)
        self._by_angle = steer_by == "angle"
        self.labels = ("speed", "steering" if self._by_angle else "turn")
        sharpest = float(curvature_of(np.array(v.max_steering), v.wheelbase))
        self.dim = 2
        self.high = np.array([speed, v.max_steering if self._by_angle else speed * sharpest])
        self.low = -self.high
        dt = self.robot.control_dt
        # apart from each other: how fast a wheel steers has nothing to do with how fast a car gathers speed
        self._speed, self._steering = Ramp(num_envs, (acceleration,), dt), Ramp(num_envs, (steering_rate,), dt)

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._drives.reset(env_ids, targets)
        self._speed.reset(env_ids)
        v = self._vehicle
        # from the angles that the wheels have: left and right of one curvature have cotangents about that of the middle
        left, right = (np.tan(targets[:, i]) for i in self._drives.steered)
        curvature = (left + right) / (2 * v.wheelbase + (left - right) * v.track / 2)
        self._steering.now[env_ids, 0] = steering_of(curvature, v.wheelbase)

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        v = self._vehicle
        wanted = np.minimum(np.maximum(action, self.low), self.high)
        steering = self._steering.toward(self._angle(wanted, env_ids)[:, None], env_ids)[:, 0]
        curvature = curvature_of(steering, v.wheelbase)
        slower = within_limits(self._wheels(wanted[:, 0], curvature), self._limits)
        speed = self._speed.toward((wanted[:, 0] * slower)[:, None], env_ids)[:, 0]
        positions = self._drives.positions(env_ids, ackermann_steering(curvature, v.wheelbase, v.track))
        return Command(positions, self._drives.velocities(env_ids, self._wheels(speed, curvature)))

    def _angle(self, wanted: Array, env_ids: Array | None) -> Array:
        """(E,) of the middle wheel [rad]."""
        if self._by_angle:
            return wanted[:, 1]
        speed, moves = wanted[:, 0], np.abs(wanted[:, 0]) > _STANDING
        found = steering_of(wanted[:, 1] / np.where(moves, speed, 1.0), self._vehicle.wheelbase)
        most = self._vehicle.max_steering
        kept = self._steering.now[rows_of(env_ids), 0]
        return np.where(moves, np.minimum(np.maximum(found, -most), most), kept)

    def _wheels(self, speed: Array, curvature: Array) -> Array:
        v = self._vehicle
        wheels = ackermann_wheels(speed, curvature, v.wheel_radius, v.wheelbase, v.track)
        return wheels[:, : len(self._drives.wheels)]

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {
            "speed": self._speed.now[env_ids],
            "steering": self._steering.now[env_ids],
            **self._drives.snapshot(env_ids),
        }

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._speed.now[env_ids], self._steering.now[env_ids] = data["speed"], data["steering"]
        self._drives.restore(env_ids, data)

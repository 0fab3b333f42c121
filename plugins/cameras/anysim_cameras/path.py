"""A camera's way through waypoints, without an action: it flies by itself in any task."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.model.world import JointType
from anysim_cameras.controller import HandHeld
from anysim_cameras.spline import Limits, through
from anysim_schemas.base import Number


class CameraPath(HandHeld):
    """Moves the joints of a channel through waypoints on a spline, from where they begin, and stays at the last one.

    It has no action. Waypoints are places of the channel's joints [m, rad], as of `x, y, z` from where the camera
    stands. The limits hold as those of `camera_motion` do: for the straight line of all sliding joints together, and
    for each turning joint by itself. Channels and cameras with the same `duration` are in step.
    """

    labels = ()

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        waypoints: Annotated[
            Sequence[Sequence[Number]], Field(min_length=1, description="one number for each joint [m, rad]")
        ],
        speed: Annotated[float, Field(gt=0, description="largest speed [m/s]")] = 1.0,
        acceleration: Annotated[float, Field(gt=0, description="largest acceleration [m/s^2]")] = 2.0,
        rate: Annotated[float, Field(gt=0, description="largest rate of a turning joint [rad/s]")] = 1.0,
        angular_acceleration: Annotated[float, Field(gt=0, description="and its acceleration [rad/s^2]")] = 3.0,
        delay: Annotated[float, Field(ge=0, description="[s] from the reset until it sets out")] = 0.0,
        duration: Annotated[
            float | None, Field(gt=0, description="[s] of the way; as short as the limits allow where left out")
        ] = None,
        shake: Annotated[float, Field(ge=0, description="root mean square of what a hand adds [m, rad]")] = 0.0,
        tremor: Annotated[float, Field(gt=0, le=10, description="how quickly the hand shakes [Hz]")] = 1.5,
    ) -> None:
        super().__init__(channel, num_envs, shake, tremor)
        k = len(channel)
        self._points = np.array([tuple(point) for point in waypoints if len(point) == k], dtype=float).reshape(-1, k)
        if len(self._points) < len(waypoints):
            drives = [channel.robot.world.actuators[a].name for a in channel.actuators]
            raise TaskError(f"waypoints: expected {k} numbers in each, of {', '.join(drives)}")
        if (self._points < channel.lower).any() or (self._points > channel.upper).any():
            raise TaskError("waypoints: one is beyond a joint's limits; `anysim robot NAME` lists them")
        self.dim, self.low, self.high = 0, np.zeros(0), np.zeros(0)
        slides = np.array([joint.type is JointType.PRISMATIC for joint in self.joints])
        together = np.flatnonzero(slides)
        self._limits = [Limits(together, speed, acceleration)] if len(together) else []
        self._limits += [Limits(np.array([i]), rate, angular_acceleration) for i in np.flatnonzero(~slides)]
        self._delay, self._duration = delay, duration
        stretches = len(self._points)
        shapes = {"times": (stretches + 1,), "cubics": (stretches, 4, k), "ticks": ()}
        self._rows |= {name: np.zeros((num_envs, *shape)) for name, shape in shapes.items()}

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._rows["ticks"][env_ids] = 0.0
        self._shake.reset(env_ids)
        for env, start in zip(env_ids.tolist(), targets, strict=True):
            way = through(np.concatenate([start[None], self._points]), self._limits)
            least = float(way.times[-1])
            if self._duration is not None and least > 0:
                if least > self._duration * (1 + 1e-9):
                    raise TaskError(f"duration: {self._duration:g} s; within the limits the way takes {least:.3f} s")
                way = way.slower(self._duration / least)
            cubics = self._rows["cubics"][env]
            self._rows["times"][env], cubics[:], stretches = way.times[-1], 0.0, len(way.cubics)
            self._rows["times"][env, : len(way.times)], cubics[:stretches] = way.times, way.cubics
            cubics[stretches:, 0] = self._points[-1]  # what is not needed is the end

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        return self.update(env_ids)

    def update(self, env_ids: Array | None) -> Command:
        rows = slice(None) if env_ids is None else env_ids
        self._rows["ticks"][rows] += 1.0
        times, every = self._rows["times"][rows], np.arange(len(self._rows["ticks"][rows]))
        now = np.minimum(np.maximum(self._rows["ticks"][rows] * self._dt - self._delay, 0.0), times[:, -1])
        stretch = (now[:, None] >= times[:, 1:-1]).sum(axis=1)
        t = (now - times[every, stretch])[:, None]
        a, b, c, d = np.moveaxis(self._rows["cubics"][rows][every, stretch], 1, 0)
        there = (now >= times[:, -1])[:, None]
        place = np.where(there, self._points[-1], a + t * (b + t * (c + t * d)))
        pace = np.where(there, 0.0, b + t * (2.0 * c + 3.0 * t * d))
        extra = self._shake.step(rows)
        place = np.minimum(np.maximum(place + extra.position, self.channel.lower), self.channel.upper)
        return Command(position=place, velocity=pace + extra.velocity)

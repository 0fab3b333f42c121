"""A gimbal: three joints that keep a camera level and turn it where it is to look."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command
from anysim.conventions import Array
from anysim.errors import NameLookupError, TaskError
from anysim.math import pose as P
from anysim.model.frames import find_frame
from anysim.model.world import JointType
from anysim_cameras.controller import HandHeld
from anysim_cameras.easing import brake_speed, room_speeds
from anysim_schemas.base import Vec3

_AXES = ("yaw about z", (0.0, 0.0, 1.0)), ("pitch about y", (0.0, 1.0, 0.0)), ("roll about x", (1.0, 0.0, 0.0))
_STEEP, _EDGE = 0.9, 0.2
"""[rad] from the horizon where it may go over the top, and by how much nearer that way has to be."""
_HELD, _CONE, _QUICK = 0.02, 1.0, 1.5
"""Tangents of angles from the vertical: what is nearer to it has no heading; within the second a pass is foreseen. It
is gone over where a level view would have to turn so many times quicker than the joint does."""


class CameraGimbal(HandHeld):
    """Keeps the horizon level in the world, however its carrier is tilted, and looks at a place or in a direction.

    The action is yaw and pitch [rad], positive pitch down: added to where `look_at` is, else from the heading of the
    robot's base and the horizon. Each joint follows with a limited rate and acceleration and with the speed of what is
    looked at fed forward, so that it does not trail behind. Right above or below what it looks at, where a level view
    would have to turn round at once, a joint of pitch without limits goes on past straight down and the roll levels the
    view afterwards, so that the eye stays on it.
    """

    labels = ("yaw", "pitch")

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        look_at: Annotated[
            Vec3 | str | None, Field(description="a point of the world [m], or a frame, as `cube` or `panda.tool`")
        ] = None,
        steered: Annotated[
            bool, Field(description="whether there is an action; without one it looks by itself")
        ] = True,
        rate: Annotated[float, Field(gt=0, description="largest rate of a joint [rad/s]")] = 3.0,
        acceleration: Annotated[float, Field(gt=0, description="largest acceleration of a joint [rad/s^2]")] = 12.0,
        response: Annotated[float, Field(gt=0, le=50, description="how fast it settles [1/s]")] = 8.0,
        shake: Annotated[float, Field(ge=0, description="root mean square of what a hand adds [rad]")] = 0.0,
        tremor: Annotated[float, Field(gt=0, le=10, description="how quickly the hand shakes [Hz]")] = 1.5,
    ) -> None:
        super().__init__(channel, num_envs, shake, tremor)
        fitting = len(self.joints) == 3 and all(
            joint.type is JointType.REVOLUTE and np.allclose(joint.axis, axis)
            for joint, (_, axis) in zip(self.joints, _AXES, strict=True)
        )
        if not fitting:
            raise TaskError(
                f"camera_gimbal needs three turning joints, {', '.join(name for name, _ in _AXES)}, one on the other; "
                f"'{channel.robot.name}.{channel.name}' has others"
            )
        self._carrier, self._eye = channel.robot.world.bodies[self.joints[0].body].parent, self.joints[2].body
        self._target = None if look_at is None else self._found(look_at)
        self.labels = type(self).labels if steered else ()
        self.dim = len(self.labels)
        self.high = np.array([np.pi, np.pi / 2])[: self.dim]
        self.low = -self.high
        self._rate, self._acceleration, self._response = rate, acceleration, response
        self._rows |= {name: np.zeros((num_envs, 3)) for name in ("position", "velocity", "wanted")}
        self._rows["asked"] = np.zeros((num_envs, 2))
        self._rows["fresh"] = np.ones((num_envs, 1))
        self._rows["over"], self._rows["aside"] = np.zeros((num_envs, 1)), np.zeros((num_envs, 2))
        self._goes_over = bool(np.isinf(channel.upper[1]))

    def _found(self, look_at: Vec3 | str) -> tuple[int, Array]:
        """The body, or -1 for the world, and the point in its frame."""
        if not isinstance(look_at, str):
            return -1, np.array(look_at, dtype=float)
        try:
            frame = find_frame(self.robot.world, look_at)
        except NameLookupError as error:
            raise TaskError(f"look_at: {error}") from None
        return frame.body, np.array(frame.position, dtype=float)

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._rows["position"][env_ids] = targets
        self._rows["wanted"][env_ids] = targets
        self._rows["velocity"][env_ids] = 0.0
        self._rows["asked"][env_ids] = 0.0
        self._rows["fresh"][env_ids] = 1.0
        self._rows["over"][env_ids] = 0.0
        self._shake.reset(env_ids)

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        if self.dim:
            self._rows["asked"][slice(None) if env_ids is None else env_ids] = action
        return self.update(env_ids)

    def update(self, env_ids: Array | None) -> Command:
        rows = slice(None) if env_ids is None else env_ids
        position, velocity = self._rows["position"][rows], self._rows["velocity"][rows]
        angles = self._angles(rows, env_ids)
        if self._goes_over:
            angles = self._nearer(rows, angles, position)
        wanted = position + P.wrapped(angles - position)
        wanted = np.minimum(np.maximum(wanted, self.channel.lower), self.channel.upper)
        before, fresh = self._rows["wanted"][rows], self._rows["fresh"][rows] > 0
        drift = np.where(fresh, 0.0, P.wrapped(wanted - before) / self._dt)
        drift = np.minimum(np.maximum(drift, -self._rate), self._rate)
        way = wanted - position
        pace = drift + np.sign(way) * brake_speed(np.abs(way), self._acceleration, self._response)
        pace = np.minimum(np.maximum(pace, -self._rate), self._rate)
        low, high = room_speeds(position, self.channel.lower, self.channel.upper, self._acceleration, self._dt)
        pace = np.minimum(np.maximum(pace, -low), high)
        change = self._acceleration * self._dt
        velocity = velocity + np.minimum(np.maximum(pace - velocity, -change), change)
        there = position + velocity * self._dt
        kept = np.minimum(np.maximum(there, self.channel.lower), self.channel.upper)
        velocity = np.where(kept == there, velocity, 0.0)
        self._rows["position"][rows], self._rows["velocity"][rows] = kept, velocity
        self._rows["wanted"][rows], self._rows["fresh"][rows] = wanted, 0.0
        extra = self._shake.step(rows)
        return Command(position=kept + extra.position, velocity=velocity + extra.velocity)

    def _nearer(self, rows: slice | Array, angles: Array, position: Array) -> Array:
        """Of the two ways to turn the joints to one view, the one at hand; near the vertical the nearer one."""
        over = self._rows["over"][rows]
        other = np.stack([angles[:, 0] + np.pi, np.pi - angles[:, 1], angles[:, 2] + np.pi], axis=1)
        left = [np.abs(P.wrapped(way - position)[:, :2]).sum(axis=1) for way in (angles, other)]
        nearer = np.where(over[:, 0] > 0, left[1] > left[0] + _EDGE, left[0] > left[1] + _EDGE)
        over = np.abs(over - (nearer & (np.abs(angles[:, 1]) > _STEEP))[:, None])
        self._rows["over"][rows] = over
        return np.where(over > 0, other, angles)

    def _angles(self, rows: slice | Array, env_ids: Array | None) -> Array:
        """Joint angles (E, 3) with which the camera is level and looks where it should."""
        asked, poses = self._rows["asked"][rows], self.robot.state.body_pose
        if self._target is None:
            turn = self.robot.base_pose(env_ids)[:, 3:]
            ahead = P.rotate(turn, np.broadcast_to(np.array([1.0, 0.0, 0.0]), (len(turn), 3)))
            yaw, pitch = np.arctan2(ahead[:, 1], ahead[:, 0]), np.zeros(len(turn))
        else:
            body, point = self._target
            eye = poses[rows, self._eye, :3]
            place = np.broadcast_to(point, eye.shape)
            if body >= 0:
                place = poses[rows, body, :3] + P.rotate(poses[rows, body, 3:], place)
            way = place - eye
            yaw = np.arctan2(way[:, 1], way[:, 0])
            if self._goes_over:
                yaw = self._heading(rows, way, yaw)
            pitch = np.arctan2(-way[:, 2], way[:, 0] * np.cos(yaw) + way[:, 1] * np.sin(yaw))
        pitch = pitch + asked[:, 1]
        roll = np.where(self._goes_over & (np.abs(pitch) > np.pi / 2), np.pi, 0.0)  # past the vertical that is level
        level = P.from_roll_pitch_yaw(np.stack([roll, pitch, yaw + asked[:, 0]], axis=1))
        turn = P.multiply(P.conjugate(poses[rows, self._carrier, 3:]), level)
        return P.to_roll_pitch_yaw(turn)[:, ::-1].copy()  # yaw, pitch, roll, as its joints are

    def _heading(self, rows: slice | Array, way: Array, yaw: Array) -> Array:
        """Headings (E,) of level views; where what is looked at passes near the vertical, that of its passing."""
        carrier = P.yaw(self.robot.state.body_pose[rows, self._carrier, 3:])
        now = self._rows["position"][rows, 0] + carrier
        aside = way[:, :2] / np.maximum(np.abs(way[:, 2:]), 1e-9)
        rate = np.where(self._rows["fresh"][rows] > 0, 0.0, (aside - self._rows["aside"][rows]) / self._dt)
        self._rows["aside"][rows] = aside
        quick, far = P.norm(rate), P.norm(aside)
        nearest = np.abs(aside[:, 0] * rate[:, 1] - aside[:, 1] * rate[:, 0]) / np.maximum(quick, 1e-12)
        passes = (far < _CONE) & (quick > _QUICK * self._rate * nearest) & (quick > 0.01)
        along = np.arctan2(rate[:, 1], rate[:, 0])
        along = along + np.where(np.abs(P.wrapped(along - now)) > np.pi / 2, np.pi, 0.0)
        return np.where(passes, along, np.where(far < _HELD, now, yaw))

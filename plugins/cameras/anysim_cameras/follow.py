"""A camera that keeps its place beside something that moves, or goes round it, without an action."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command
from anysim.conventions import Array
from anysim.errors import NameLookupError, TaskError
from anysim.math import pose as P
from anysim.model.frames import find_frame
from anysim.model.world import JointType
from anysim_cameras.controller import HandHeld
from anysim_cameras.easing import brake_speed, shortened, toward
from anysim_schemas.base import Vec3


class CameraFollow(HandHeld):
    """Keeps the camera at an offset from a frame, and carries it round the vertical through that frame if asked.

    It has no action. The speed of the frame is fed forward, so that the camera does not trail behind it; when the frame
    is quicker than the limits allow, or jumps, the camera catches up within them.
    """

    labels = ()

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        frame: Annotated[str, Field(description="what is followed, as `cube` or `panda.tool`")],
        offset: Annotated[
            Vec3 | None, Field(description="[m] from the frame; where the camera begins where left out")
        ] = None,
        axes: Annotated[Literal["world", "heading"], Field(description="of the offset: the frame's yaw")] = "world",
        turn: Annotated[float, Field(description="[rad/s] of the offset about the vertical: an orbit")] = 0.0,
        speed: Annotated[float, Field(gt=0, description="largest speed [m/s]")] = 2.0,
        acceleration: Annotated[float, Field(gt=0, description="largest acceleration [m/s^2]")] = 4.0,
        response: Annotated[float, Field(gt=0, le=50, description="how fast it settles [1/s]")] = 4.0,
        shake: Annotated[float, Field(ge=0, description="root mean square of what a hand adds [m]")] = 0.0,
        tremor: Annotated[float, Field(gt=0, le=10, description="how quickly the hand shakes [Hz]")] = 1.5,
    ) -> None:
        super().__init__(channel, num_envs, shake, tremor)
        world = channel.robot.world
        if [(j.type, j.axis) for j in self.joints] != [
            (JointType.PRISMATIC, tuple(axis)) for axis in np.eye(3).tolist()
        ]:
            raise TaskError(
                f"camera_follow needs three sliding joints along x, y and z; "
                f"'{channel.robot.name}.{channel.name}' has others"
            )
        try:
            found = find_frame(world, frame)
        except NameLookupError as error:
            raise TaskError(f"frame: {error}") from None
        self._body, self._local = found.body, P.pose(found.position, found.quaternion)
        self.dim, self.low, self.high = 0, np.zeros(0), np.zeros(0)
        self._offset, self._heading, self._turn = offset, axes == "heading", turn
        self._speed, self._acceleration, self._response = speed, acceleration, response
        self._rows |= {name: np.zeros((num_envs, 3)) for name in ("position", "velocity", "wanted", "offset")}
        self._rows["ticks"] = np.zeros((num_envs, 1))

    def reset(self, env_ids: Array, targets: Array) -> None:
        self._rows["position"][env_ids], self._rows["velocity"][env_ids] = targets, 0.0
        self._rows["ticks"][env_ids] = 0.0
        self._shake.reset(env_ids)
        if self._offset is not None:
            self._rows["offset"][env_ids] = self._offset
            return
        base, frame = self.robot.base_pose(env_ids), self._frame(env_ids)
        way = base[:, :3] + P.rotate(base[:, 3:], targets) - frame[:, :3]
        self._rows["offset"][env_ids] = self._turned(way, -self._yaw(frame))

    def _frame(self, rows: slice | Array) -> Array:
        pose = self.robot.state.body_pose[rows, self._body]
        return P.compose(pose, np.broadcast_to(self._local, pose.shape))

    def _yaw(self, frame: Array) -> Array:
        return P.yaw(frame[:, 3:]) if self._heading else np.zeros(len(frame))

    @staticmethod
    def _turned(way: Array, yaw: Array) -> Array:
        return P.rotate(P.from_axis_angle(np.array([0.0, 0.0, 1.0]), yaw), way)

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        return self.update(env_ids)

    def update(self, env_ids: Array | None) -> Command:
        rows = slice(None) if env_ids is None else env_ids
        state = {name: values[rows] for name, values in self._rows.items()}
        frame, base = self._frame(rows), self.robot.base_pose(env_ids)
        yaw = self._yaw(frame) + self._turn * self._dt * state["ticks"][:, 0]
        place = frame[:, :3] + self._turned(state["offset"], yaw)
        wanted = P.rotate_inverse(base[:, 3:], place - base[:, :3])
        wanted = np.minimum(np.maximum(wanted, self.channel.lower), self.channel.upper)
        drift = np.where(state["ticks"] == 0.0, 0.0, (wanted - state["wanted"]) / self._dt)
        way = wanted - state["position"]
        distance = P.norm(way)
        pace = brake_speed(distance, self._acceleration, self._response) / np.maximum(distance, 1e-12)
        asked = shortened(shortened(drift, self._speed) + way * pace[:, None], self._speed)
        velocity = toward(state["velocity"], asked, self._acceleration * self._dt)
        there = state["position"] + velocity * self._dt
        kept = np.minimum(np.maximum(there, self.channel.lower), self.channel.upper)
        velocity = np.where(kept == there, velocity, 0.0)
        self._rows["position"][rows], self._rows["velocity"][rows] = kept, velocity
        self._rows["wanted"][rows] = wanted
        self._rows["ticks"][rows] = state["ticks"] + 1.0
        extra = self._shake.step(rows)
        return Command(position=kept + extra.position, velocity=velocity + extra.velocity)

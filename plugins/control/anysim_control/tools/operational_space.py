"""`operational_space`: tools behave as masses on springs, whatever the pose of the arm (Khatib's formulation)."""

from typing import Annotated, Literal, Unpack

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command
from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import ControlMode
from anysim_control.tools.controller import ToolController, ToolOptions
from anysim_control.tools.link_effort import CarryWeight
from anysim_control.tools.task_space import TaskSpace

Gain = Annotated[float, Field(gt=0)]


class OperationalSpace(ToolController):
    """Efforts that accelerate the tools towards their targets, and in what they leave free the joints to the posture.

    The inertia is that of the channel's joints on a base that stands still; joints of other channels are taken as held.
    Where the catalogue says that the robot's own controller cancels its weight, the engine does, and no effort is spent
    on it here; elsewhere the effort carries the links beyond the channel's joints.

    With `drives: effort` the drives give the effort and nothing else. With `drives: position` they keep their own
    gains about the motion that the effort is expected to give, as on robots that take feed-forward torques only.
    """

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        stiffness: Annotated[Gain, Field(description="acceleration by distance of a tool [1/s^2]")] = 400.0,
        damping_ratio: Annotated[Gain, Field(description="1 arrives soonest without going beyond")] = 1.0,
        posture_stiffness: Annotated[Gain, Field(description="acceleration by distance of a joint [1/s^2]")] = 20.0,
        max_speed: Annotated[Gain, Field(description="of a tool on the way to a far target [m/s]")] = 1.0,
        max_turn_rate: Annotated[Gain, Field(description="of a tool on the way to a far target [rad/s]")] = 2.5,
        drives: Annotated[
            Literal["effort", "position"], Field(description="what the drives obey besides the effort")
        ] = "effort",
        carry_weight: CarryWeight = None,
        period: Annotated[float, Field(gt=0, description="[s] between efforts; at least a physics step")] = 0.002,
        **options: Unpack[ToolOptions],
    ) -> None:
        super().__init__(channel, num_envs, **options)
        self.mode = ControlMode.EFFORT if drives == "effort" else ControlMode.POSITION
        dt, control_dt = self.robot.dt, self.robot.control_dt
        self.period = min(max(1, round(period / dt)) * dt, control_dt)
        self._space = TaskSpace(
            self.frames,
            stiffness=stiffness,
            damping_ratio=damping_ratio,
            posture_stiffness=posture_stiffness,
            max_speed=max_speed,
            max_turn_rate=max_turn_rate,
            oriented=self.targets.oriented,
            carry_weight=carry_weight,
        )
        shape = (num_envs, len(self.frames), 7)
        self._earlier, self._before, self._after = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        """The targets at the end of this control step and of the two before, base frame: tools are led along them."""
        self._time = np.zeros(num_envs)
        """[s] since the last action."""
        self._state = {
            "earlier": self._earlier,
            "before": self._before,
            "after": self._after,
            "posture": self._posture,
            "time": self._time,
        }
        self._far = np.array([max_speed, max_turn_rate]) * control_dt

    def _begin(self, env_ids: Array, targets: Array, poses: Array) -> None:
        self._earlier[env_ids], self._before[env_ids], self._after[env_ids] = poses, poses, poses
        self._time[env_ids] = 0.0

    def _follow(self, joint_pos: Array, target: Array, env_ids: Array | None) -> Command:
        rows = slice(None) if env_ids is None else env_ids
        self._earlier[rows] = self._before[rows]
        self._before[rows] = self._after[rows]
        self._after[rows], self._time[rows] = target, 0.0
        return self._command(env_ids)

    def update(self, env_ids: Array | None) -> Command:
        self._time[slice(None) if env_ids is None else env_ids] += self.period or 0.0
        return self._command(env_ids)

    def _command(self, env_ids: Array | None) -> Command:
        rows = slice(None) if env_ids is None else env_ids
        goal, twist, change = self._led(rows)
        pos, vel = self.robot.joint_pos(env_ids), self.robot.joint_vel(env_ids)
        base, posture = self.robot.base_pose(env_ids), self._posture[rows]
        effort, acceleration = np.empty(posture.shape), np.empty(posture.shape)
        for row in range(len(pos)):
            effort[row], acceleration[row] = self._space.effort(
                pos[row], vel[row], goal[row], twist[row], change[row], posture[row], base[row]
            )
        if self.mode is ControlMode.EFFORT:
            return Command(effort=effort)
        # Halfway through the period, where the motion is on average: the drives' gains then act on deviations alone.
        half = 0.5 * (self.period or 0.0)
        own, rate = pos[:, self.channel.joint_columns], vel[:, self.channel.joint_columns]
        return Command(position=own + half * rate, velocity=rate + half * acceleration, effort=effort)

    def _led(self, rows: slice | Array) -> tuple[Array, Array, Array]:
        """Where tools are to be now (E, T, 7), how fast (E, T, 6), and the change of that (E, T, 6).

        A tool that is far from its target is sent there at once.
        """
        earlier, before, after = self._earlier[rows], self._before[rows], self._after[rows]
        control_dt = self.robot.control_dt
        share = np.minimum((self._time[rows] + (self.period or 0.0)) / control_dt, 1.0)[:, None]
        way, last = _way(before, after), _way(earlier, before)
        near, was_near = self._near(way), self._near(last)
        turn = way[..., 3:]
        angle = P.norm(turn)
        axis = turn / np.where(angle > 0.0, angle, 1.0)[..., None]
        part = P.normalize(P.multiply(P.from_axis_angle(axis, share * angle), before[..., 3:]))
        goal = np.concatenate([before[..., :3] + share[..., None] * way[..., :3], part], axis=-1)
        change = np.where(near & was_near, (way - last) / control_dt**2, 0.0)
        return np.where(near, goal, after), np.where(near, way / control_dt, 0.0), change

    def _near(self, way: Array) -> Array:
        """(E, T, 1) bool."""
        return ((P.norm(way[..., :3]) <= self._far[0]) & (P.norm(way[..., 3:]) <= self._far[1]))[..., None]


def _way(start: Array, goal: Array) -> Array:
    """(..., 6) translation and rotation vector from poses to poses (..., 7)."""
    turn = P.rotation_vector(P.multiply(goal[..., 3:], P.conjugate(start[..., 3:])))
    return np.concatenate([goal[..., :3] - start[..., :3], turn], axis=-1)

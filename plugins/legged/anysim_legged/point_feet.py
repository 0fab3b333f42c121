"""Stepping of a biped on point feet: it cannot stand still, and each step lands where the next one can begin.

A point foot has no centre of pressure to move, so that balance is the place and the time of steps alone. The capture
point (divergent component of motion) runs away from the foot that stands, and the other lands where what is left of it
is what a steady gait has there (Khadiv, Herzog, Moosavian and Righetti 2016, Step timing adjustment: a step toward
generating robust gaits). The standing leg is a force through its joints: it holds the height and the trunk upright.
"""

from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command, Controller
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.kinematics.pinocchio_model import pinocchio
from anysim.math import pose as P
from anysim_legged.legs import Legs, solve
from anysim_legged.tracking import tick_of
from anysim_legged.wholebody import about_z

LIFT, SINK = 80.0, 16.0
"""[1/s^2], [1/s] How hard the standing leg holds the height of the centre of mass, and damps it."""
UPRIGHT, CALM = 1.1, 0.07
"""[1], [s] The same of the trunk's lean, in units of what gravity tips it with."""
GRIP = 0.6
"""Largest part of its load that the standing foot pushes sideways."""
AHEAD, NEAR, FAR = 0.2, 0.06, 0.3
"""[m] How far a foot lands from the one that stands: ahead or back; to its own side, at least and at most."""
DOWN = 0.6
"""Part of a step from which on the swinging foot may touch the ground, and the next step begins."""
ARRIVED = 0.9
"""Part of a step in which the swinging foot comes to its place; then it only goes down."""


class Body(NamedTuple):
    """What is measured of an env, world frame."""

    com: Array
    speed: Array
    turn: Array
    """(3, 3) of the base."""
    base: Array
    """(3,) its place."""
    twist: Array
    """(6,)"""
    joints: Array
    """(2, 3) of the legs, and their rates."""
    rates: Array
    feet: Array
    """(2, 3)"""


class PointFootWalk(Controller):
    """Steps with the velocity of the action in the robot's heading: forward [m/s], left [m/s]; on the spot at zero.

    Its heading drifts, and no action turns it: a point foot gives no torque about the vertical.

    Args:
        channel, num_envs: as for every controller.
        step: [s] from one landing to the next; the foot is down a little earlier.
        clearance: height of a swinging foot's path [m].
        width: between the feet of the steady gait [m].
        limits: largest velocities [m/s].
        tracking: how fast lasting errors of speed are mended [1/s].

    Raises:
        TaskError: a robot without a left and a right leg of three joints.
    """

    labels = ("forward", "left")
    period: float = 0.002

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        step: Annotated[float, Field(gt=0)] = 0.16,
        clearance: Annotated[float, Field(gt=0)] = 0.04,
        width: Annotated[float, Field(gt=0)] = 0.16,
        limits: tuple[Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]] = (0.3, 0.1),
        tracking: Annotated[float, Field(ge=0)] = 0.5,
    ) -> None:
        super().__init__(channel, num_envs)
        robot, model = self.robot, self.robot.kinematics
        if set(robot.entry.legs) != {"left", "right"}:
            raise TaskError(f"'{robot.name}' ({robot.entry.name}) cannot step: it needs the legs 'left' and 'right'")
        self.legs = Legs.of(robot)
        there = {int(column): i for i, column in enumerate(self.channel.joint_columns)}
        self._order = np.array([[there[int(column)] for column in leg] for leg in self.legs.columns])
        self._tick = tick_of(self.period, robot.dt, robot.control_dt, robot.name)
        self.dim, self.high = 2, np.array(limits)
        self.low = -self.high
        home = model.q(model.initial)
        self._height = float(model.com(home)[2] - home[2] - self.legs.feet(self.legs.home[None])[0, :, 2].mean())
        self._gravity = float(-robot.world.physics.gravity[2])
        self._omega = float(np.sqrt(self._gravity / self._height))
        self._grows = float(np.exp(self._omega * step))
        self._step, self._clearance, self._width, self._tracking = step, clearance, width, tracking
        self._sides = np.array([1.0 if name == "left" else -1.0 for name in self.legs.names])
        self._wanted, self._slip = np.zeros((num_envs, 2)), np.zeros((num_envs, 2))
        self._time = np.zeros(num_envs)
        """Since this step began [s]; below zero while both feet still stand."""
        self._stance = np.zeros(num_envs, dtype=np.int64)
        self._lifted = np.zeros((num_envs, 3))

    def reset(self, env_ids: Array, targets: Array) -> None:
        for values in (self._wanted, self._slip, self._stance, self._lifted):
            values[env_ids] = 0
        self._time[env_ids] = -1.0

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        self._wanted[slice(None) if env_ids is None else env_ids] = action
        return self.update(env_ids)

    def update(self, env_ids: Array | None) -> Command:
        envs = np.arange(self.num_envs) if env_ids is None else env_ids
        joints, rates = self.robot.joint_pos(env_ids), self.robot.joint_vel(env_ids)
        bases, twists = self.robot.base_pose(env_ids), self.robot.base_twist(env_ids)
        columns = self.channel.joint_columns
        position, velocity = joints[:, columns].copy(), rates[:, columns].copy()
        effort = np.zeros_like(position)
        for row, env in enumerate(envs):
            body = self._body(joints[row], rates[row], bases[row], twists[row])
            self._follow(int(env), body)
            stance = int(self._stance[env])
            effort[row, self._order[stance]] = self._carry(body, stance)
            if self._time[env] >= 0.0:
                swing = self._order[1 - stance]
                position[row, swing], velocity[row, swing] = self._swing(int(env), body)
                self._time[env] += self._tick
        return Command(position, velocity, None, effort)

    def _body(self, joints: Array, rates: Array, base: Array, twist: Array) -> Body:
        model, columns = self.robot.kinematics, self.legs.columns
        pinocchio().centerOfMass(model.model, model.data, model.q(joints, base), model.v(rates, base, twist), False)
        turn = P.to_matrix(base[3:])
        feet = base[:3] + self.legs.feet(joints[columns][None])[0] @ turn.T
        com, speed = np.array(model.data.com[0]), np.array(model.data.vcom[0])
        return Body(com, speed, turn, base[:3], twist, joints[columns], rates[columns], feet)

    def _follow(self, env: int, body: Body) -> None:
        """Which foot stands: begin the next step where this one has ended."""
        stance = int(self._stance[env])
        swing = 1 - stance
        if self._time[env] < 0.0:  # this foot pushes the body over the other, on which it will come to stand
            away = self._heading(body).T @ (self._capture_point(body) - body.feet[swing, :2])
            ended = -self._sides[swing] * away[1] < 1.3 * self._width / (1.0 + self._grows)
        else:
            touched = body.feet[swing, 2] - body.feet[stance, 2] < 0.001
            ended = self._time[env] >= (DOWN if touched else 1.0) * self._step
        if ended:
            self._stance[env], self._time[env], self._lifted[env] = swing, 0.0, body.feet[stance]

    def _capture_point(self, body: Body) -> Array:
        return body.com[:2] + body.speed[:2] / self._omega

    def _heading(self, body: Body) -> Array:
        return about_z(float(np.arctan2(body.turn[1, 0], body.turn[0, 0])))[:2, :2]

    def _carry(self, body: Body, stance: int) -> Array:
        """Efforts (3,) of the standing leg: a force on the ground that holds the height and turns the trunk upright."""
        mass = self.robot.kinematics.mass
        arm = body.feet[stance] - body.com
        weight, height = mass * self._gravity, -float(arm[2])
        load = weight + mass * (LIFT * (self._height - height) - SINK * float(body.speed[2]))
        load = float(np.clip(load, 0.3 * weight, 2.0 * weight))
        up = body.turn[:, 2]
        moment = weight * self._height * (UPRIGHT * np.array([up[1], -up[0]]) - CALM * body.twist[3:5])
        flat = np.array([-moment[1] - arm[0] * load, moment[0] - arm[1] * load]) / height
        flat *= min(1.0, GRIP * load / max(float(np.hypot(*flat)), 1e-9))
        jacobian = self.legs.jacobian(body.joints[None])[0, stance]
        return -jacobian.T @ (body.turn.T @ np.append(flat, load))

    def _landing(self, env: int, body: Body) -> Array:
        """Where the swinging foot lands (2,)."""
        stance = int(self._stance[env])
        side, turn = self._sides[1 - stance], self._heading(body)
        left = self._step - min(float(self._time[env]), self._step)
        there = turn.T @ (self._capture_point(body) - body.feet[stance, :2]) * np.exp(self._omega * left)
        speed = turn.T @ body.speed[:2]
        lag = self._wanted[env] - speed
        self._slip[env] = np.clip(self._slip[env] + self._tick * self._tracking * lag, -self.high, self.high)
        offset = (self._wanted[env] + self._slip[env]) * self._step / (self._grows - 1.0)
        x, y = there - offset
        y += side * self._width / (1.0 + self._grows)
        place = np.array([np.clip(x, -AHEAD, AHEAD), side * np.clip(side * y, NEAR, FAR)])
        return body.feet[stance, :2] + turn @ place

    def _swing(self, env: int, body: Body) -> tuple[Array, Array]:
        """Positions (3,) and rates (3,) of the swinging leg."""
        stance = int(self._stance[env])
        swing, start, part = 1 - stance, self._lifted[env], float(self._time[env]) / self._step
        s = min(part / ARRIVED, 1.0)
        share, slope = s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / (ARRIVED * self._step)
        way = np.append(self._landing(env, body), body.feet[stance, 2]) - start
        place, rate = start + share * way, slope * way
        place[2] += self._clearance * (16.0 * (s * (1.0 - s)) ** 2 - 0.5 * max(part - ARRIVED, 0.0))
        rate[2] += self._clearance * 32.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (ARRIVED * self._step)
        feet, rates = (body.feet - body.base) @ body.turn, np.zeros((2, 3))
        feet[swing] = body.turn.T @ (place - body.base)
        rates[swing] = body.turn.T @ (rate - body.twist[:3] - np.cross(body.twist[3:], place - body.base))
        posture = self.legs.inverse(feet[None])
        joints = np.clip(posture.joints[0, swing], self.legs.lower[swing], self.legs.upper[swing])
        return joints, np.clip(solve(posture.jacobian, rates[None])[0, swing], -20.0, 20.0)

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {name: values[env_ids].copy() for name, values in self._arrays().items()}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        for name, values in self._arrays().items():
            values[env_ids] = data[name]

    def _arrays(self) -> dict[str, Array]:
        return {
            "wanted": self._wanted,
            "slip": self._slip,
            "time": self._time,
            "stance": self._stance,
            "lifted": self._lifted,
        }

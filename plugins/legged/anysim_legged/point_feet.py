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
    """What is measured of the envs at hand, world frame."""

    com: Array
    """(n, 3)"""
    speed: Array
    """(n, 3)"""
    base: Array
    """(n, 7) its pose."""
    twist: Array
    """(n, 6)"""
    joints: Array
    """(n, 2, 3) of the legs."""
    feet: Array
    """(n, 2, 3)"""
    heading: Array
    """(n, 2) cosine and sine of the direction in which the base looks."""

    def into(self, way: Array) -> Array:
        """Vectors (n, 2) over the ground, in the heading's axes."""
        c, s = self.heading[:, 0], self.heading[:, 1]
        return np.stack([c * way[:, 0] + s * way[:, 1], c * way[:, 1] - s * way[:, 0]], axis=1)

    def out_of(self, way: Array) -> Array:
        """The same back into the world's axes."""
        c, s = self.heading[:, 0], self.heading[:, 1]
        return np.stack([c * way[:, 0] - s * way[:, 1], s * way[:, 0] + c * way[:, 1]], axis=1)

    def rows(self, picked: Array) -> "Body":
        """Those of some rows."""
        return Body(*(values[picked] for values in self))


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
        columns = self.channel.joint_columns
        position, velocity = joints[:, columns].copy(), rates[:, columns].copy()
        effort = np.zeros_like(position)
        body = self._body(joints, rates, self.robot.base_pose(env_ids), self.robot.base_twist(env_ids))
        self._follow(envs, body)
        rows, stance = np.arange(len(envs)), self._stance[envs]
        effort[rows[:, None], self._order[stance]] = self._carry(body, stance)
        going = np.flatnonzero(self._time[envs] >= 0.0)
        if len(going):
            swing = self._order[1 - stance[going]]
            place, rate = self._swing(envs[going], body.rows(going))
            position[going[:, None], swing], velocity[going[:, None], swing] = place, rate
            self._time[envs[going]] += self._tick
        return Command(position, velocity, None, effort)

    def _body(self, joints: Array, rates: Array, base: Array, twist: Array) -> Body:
        model, of_legs = self.robot.kinematics, joints[:, self.legs.columns]
        com, speed = np.empty((len(joints), 3)), np.empty((len(joints), 3))
        for row in range(len(joints)):
            q, v = model.q(joints[row], base[row]), model.v(rates[row], base[row], twist[row])
            pinocchio().centerOfMass(model.model, model.data, q, v, False)
            com[row], speed[row] = model.data.com[0], model.data.vcom[0]
        feet = base[:, None, :3] + P.rotate(_each(base, 2), self.legs.feet(of_legs))
        yaw = P.yaw(base[:, 3:])
        return Body(com, speed, base, twist, of_legs, feet, np.stack([np.cos(yaw), np.sin(yaw)], axis=1))

    def _follow(self, envs: Array, body: Body) -> None:
        """Which foot stands: begin the next step where this one has ended."""
        rows, stance, time = np.arange(len(envs)), self._stance[envs], self._time[envs]
        swing = 1 - stance
        # before the first step this foot pushes the body over the other, on which it will come to stand
        away = body.into(self._capture_point(body) - body.feet[rows, swing, :2])
        over = -self._sides[swing] * away[:, 1] < 1.3 * self._width / (1.0 + self._grows)
        touched = body.feet[rows, swing, 2] - body.feet[rows, stance, 2] < 0.001
        ended = np.where(time < 0.0, over, time >= np.where(touched, DOWN, 1.0) * self._step)
        now = envs[ended]
        self._stance[now], self._time[now], self._lifted[now] = swing[ended], 0.0, body.feet[rows, stance][ended]

    def _capture_point(self, body: Body) -> Array:
        return body.com[:, :2] + body.speed[:, :2] / self._omega

    def _carry(self, body: Body, stance: Array) -> Array:
        """Efforts (n, 3) of standing legs: a force on the ground that holds the height and turns the trunk upright."""
        mass, rows = self.robot.kinematics.mass, np.arange(len(stance))
        arm = body.feet[rows, stance] - body.com
        weight, height = mass * self._gravity, -arm[:, 2]
        load = weight + mass * (LIFT * (self._height - height) - SINK * body.speed[:, 2])
        load = np.clip(load, 0.3 * weight, 2.0 * weight)
        up = P.rotate(body.base[:, 3:], np.broadcast_to([0.0, 0.0, 1.0], (len(stance), 3)))
        lean = np.stack([up[:, 1], -up[:, 0]], axis=1)
        moment = weight * self._height * (UPRIGHT * lean - CALM * body.twist[:, 3:5])
        flat = np.stack([-moment[:, 1] - arm[:, 0] * load, moment[:, 0] - arm[:, 1] * load], axis=1) / height[:, None]
        flat *= np.minimum(1.0, GRIP * load / np.maximum(np.hypot(flat[:, 0], flat[:, 1]), 1e-9))[:, None]
        jacobian = self.legs.jacobian(body.joints)[rows, stance]
        force = P.rotate_inverse(body.base[:, 3:], np.concatenate([flat, load[:, None]], axis=1))
        return -(jacobian * force[:, :, None]).sum(axis=1)

    def _landing(self, envs: Array, body: Body, stance: Array) -> Array:
        """Where the swinging feet land (n, 2)."""
        side = self._sides[1 - stance]
        left = self._step - np.minimum(self._time[envs], self._step)
        standing = body.feet[np.arange(len(envs)), stance, :2]
        there = body.into(self._capture_point(body) - standing) * np.exp(self._omega * left)[:, None]
        lag = self._wanted[envs] - body.into(body.speed)
        self._slip[envs] = np.clip(self._slip[envs] + self._tick * self._tracking * lag, -self.high, self.high)
        place = there - (self._wanted[envs] + self._slip[envs]) * self._step / (self._grows - 1.0)
        place[:, 1] = side * np.clip(side * place[:, 1] + self._width / (1.0 + self._grows), NEAR, FAR)
        place[:, 0] = np.clip(place[:, 0], -AHEAD, AHEAD)
        return standing + body.out_of(place)

    def _swing(self, envs: Array, body: Body) -> tuple[Array, Array]:
        """Positions (n, 3) and rates (n, 3) of the swinging legs."""
        rows, stance = np.arange(len(envs)), self._stance[envs]
        swing, start, part = 1 - stance, self._lifted[envs], self._time[envs] / self._step
        s = np.minimum(part / ARRIVED, 1.0)
        share, slope = s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / (ARRIVED * self._step)
        way = np.column_stack([self._landing(envs, body, stance), body.feet[rows, stance, 2]]) - start
        place, rate = start + share[:, None] * way, slope[:, None] * way
        place[:, 2] += self._clearance * (16.0 * (s * (1.0 - s)) ** 2 - 0.5 * np.maximum(part - ARRIVED, 0.0))
        rate[:, 2] += self._clearance * 32.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (ARRIVED * self._step)
        turn, moved = body.base[:, 3:], place - body.base[:, :3]
        feet, rates = (
            P.rotate_inverse(_each(body.base, 2), body.feet - body.base[:, None, :3]),
            np.zeros_like(body.feet),
        )
        feet[rows, swing] = P.rotate_inverse(turn, moved)
        carried = body.twist[:, :3] + P.cross(body.twist[:, 3:], moved)
        rates[rows, swing] = P.rotate_inverse(turn, rate - carried)
        posture = self.legs.inverse(feet)
        joints = np.clip(posture.joints[rows, swing], self.legs.lower[swing], self.legs.upper[swing])
        return joints, np.clip(solve(posture.jacobian, rates)[rows, swing], -20.0, 20.0)

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


def _each(pose: Array, count: int) -> Array:
    """(n, count, 4) the turn of poses (n, 7) for several points of each."""
    return np.broadcast_to(pose[:, None, 3:], (len(pose), count, 4))

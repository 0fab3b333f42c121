"""Following a planned posture with the whole body: references, feedback of balance and feed-forward, of every env.

The plan has a frame of its own: the world at the reset. What is measured is brought into it by the feet that stand, so
that a foot that slipped a little, or landed a little short, moves the plan along instead of bending the robot.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from anysim.controllers.base import ChannelView
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim_legged.contact import Pushes, pressure, share_of, shifted
from anysim_legged.support import convex_hull, nearest_inside, shrunken
from anysim_legged.wholebody import Targets, WholeBody

FOLLOW = 25.0
"""[rad/s] how fast the model of joints that others move follows them: smooth enough to be differentiated twice."""


class Orders(NamedTuple):
    """Commands of one env."""

    position: Array
    """(K,) of the channel's joints."""
    velocity: Array
    effort: Array
    """(D,) of all drives of the robot."""
    error: Array
    """(2,) of the capture point, measured less planned [m]."""
    pressure: Array
    """(2,) its centre that the plan needs, in the plan's frame."""
    corners: Array
    """(H, 2) of the ground that the feet can press on."""


class Tracker:
    """References (N, ...) and what turns them into commands, one env at a time.

    Attributes:
        whole: the robot's mechanics.
        q, v: (N, nq), (N, nv) the planned configuration and velocity, in the plan's frame.
        tick: [s] between two calls of `follow`.
    """

    def __init__(self, channel: ChannelView, num_envs: int, period: float, gain: float, margin: float) -> None:
        self.robot = channel.robot
        self.whole = WholeBody(channel.robot.kinematics, channel)
        self.tick = tick_of(period, self.robot.dt, self.robot.control_dt, self.robot.name)
        self._gain = gain
        self._soles = np.array([shrunken(sole, margin) for sole in self.whole.soles])
        self._pushes = Pushes(self.whole, self.robot, self._soles)
        self._posture = self.whole.home[7 + self.whole.columns]
        self._gravity = float(-self.robot.world.physics.gravity[2])
        model = self.whole.model.model
        self.q = np.tile(self.whole.home, (num_envs, 1))
        self.v = np.zeros((num_envs, model.nv))
        self._shares = np.full((num_envs, 2), 0.5)
        self._feet = np.zeros((num_envs, 2, 3))
        self.lead = np.zeros((num_envs, 3))
        """What slipping added up to: place and heading of the world at the reset in the plan's frame [m, rad]."""

    def begin(self, env: int, joint_pos: Array, base: Array) -> Array:
        """The env was reset: plan from what is measured. Returns the feet's places (2, 3)."""
        self.q[env] = self.whole.model.q(joint_pos, base)
        self.v[env] = 0.0
        self._shares[env] = 0.5
        places = self.whole.places(self.q[env])
        self._feet[env] = places
        self.lead[env] = 0.0
        bottoms = [
            self.whole.model.data.oMf[f].translation[2] - h
            for f, h in zip(self.whole.feet, self.whole.sole_heights, strict=True)
        ]
        self.q[env, 2] -= min(bottoms)  # the plan stands on z = 0 wherever the ground is
        return places

    def follow(
        self,
        env: int,
        targets: Targets,
        standing: tuple[bool, bool],
        seen: tuple[Array, Array],
        jump: Array | None = None,
    ) -> Orders:
        """Advance the plan of an env by a tick to `targets`, and command it.

        Args:
            env: which.
            targets: what the posture must do at the end of this tick, in the plan's frame.
            standing: which feet carry.
            seen: the measured configuration (nq,) and velocity (nv,).
            jump: (2,) [m/s] by which the plan's speed of the centre of mass is another from this tick on: the plan was
                changed, and nothing has to push for it.
        """
        whole, tick = self.whole, self.tick
        before, rate = self.q[env].copy(), self.v[env].copy()
        start = before.copy()
        others = whole.others
        away = seen[0][7 + others] - before[7 + others]
        pull = FOLLOW**2 * away - 2.0 * FOLLOW * rate[6 + others]
        start[7 + others] += tick * (rate[6 + others] + tick * pull)
        q = whole.solve(start, targets, self._posture)
        v = whole.difference(before, q) / tick
        if jump is not None:
            unmoved = whole.solve(start, targets._replace(com=targets.com - tick * jump), self._posture)
            rate += v - whole.difference(before, unmoved) / tick
        a = (v - rate) / tick
        self.q[env], self.v[env] = q, v
        efforts, force, torque = self._pushes.required(q, v, a)
        # What is measured belongs to the beginning of the tick: compared with the plan's end, it seems to lag by a tick
        # of motion, several millimetres, and the feedback presses the soles' outer rims to catch up.
        now, speed, _ = whole.measured(before, (rate + v) / 2.0)
        omega = np.sqrt(self._gravity / now[2])
        error = self._capture_point(env, seen, omega) - (now[:2] + speed[:2] / omega)
        com, _, _ = whole.measured(q, v)
        cop = pressure(force, torque)
        corners = self.corners(targets.feet, standing)
        wanted = nearest_inside(cop + self._gain * error, corners)
        force, torque = shifted(force, torque, wanted - cop, com)
        both = standing[0] and standing[1]
        shares = share_of(wanted, whole.middles(targets.feet)) if both else np.array(standing, dtype=float)
        effort = self._pushes.solve(q, efforts, force, torque, targets.feet, targets.lift, shares)
        self._shares[env], self._feet[env] = shares, targets.feet
        return Orders(q[7 + whole.columns], v[6 + whole.columns], effort, error, cop, corners)

    def _capture_point(self, env: int, seen: tuple[Array, Array], omega: float) -> Array:
        """Where the measured robot would come to rest (2,), in the plan's frame."""
        com, speed, places = self.whole.measured(*seen)
        shares, feet = self._shares[env], self._feet[env]
        turn = sum(float(shares[k]) * P.wrapped(feet[k, 2] - places[k, 2]) for k in range(2))
        c, s = np.cos(turn), np.sin(turn)
        rotation = np.array([[c, -s], [s, c]])
        offset = (shares[:, None] * (feet[:, :2] - places[:, :2] @ rotation.T)).sum(axis=0)
        self.lead[env] = [*offset, turn]
        return rotation @ (com[:2] + speed[:2] / omega) + offset

    def corners(self, places: Array, standing: tuple[bool, bool]) -> Array:
        """Corners (H, 2) of the ground that feet at those places can press on, in the plan's frame."""
        return convex_hull(self.whole.corners(places, standing, self._soles))

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of the plan."""
        return {name: values[env_ids].copy() for name, values in self._arrays().items()}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned."""
        for name, values in self._arrays().items():
            values[env_ids] = data[name]

    def _arrays(self) -> dict[str, Array]:
        return {"q": self.q, "v": self.v, "shares": self._shares, "feet": self._feet, "lead": self.lead}


def tick_of(period: float, dt: float, control_dt: float, robot: str) -> float:
    """The time between two commands, which must fit into a control step a whole number of times."""
    steps, substeps = max(1, round(period / dt)), round(control_dt / dt)
    if steps >= substeps:
        return control_dt
    if substeps % steps:
        raise TaskError(
            f"'{robot}': control_dt {control_dt:g} s is no multiple of the controller's period of {steps * dt:g} s; "
            f"give physics.control_dt a multiple of it"
        )
    return steps * dt

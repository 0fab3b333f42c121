"""A base on wheels as skills drive it: a pose on the ground to go to in each env, straight and turning in free space.

A base that moves to all sides goes straight to its goal while it turns. One with a differential drive turns towards the
goal, drives there, and turns again. Obstacles are not seen but by a planner: a `Base` among `anysim.planners`.
"""

from collections.abc import Sequence
from typing import ClassVar, NamedTuple, Self

import numpy as np

from anysim import registry
from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.math import pose as P
from anysim.skills.phases import Mover
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim_skills.env_lifetime import PerEnv

HOLONOMIC, DIFFERENTIAL = ("forward", "left", "turn"), ("speed", "turn")
"""Components of the actions that it can give."""
TOWARDS, ALONG, ROUND = range(3)
"""What a differential base does: it turns towards its goal, drives, or turns at the goal."""
ALIGNED = np.deg2rad(2.0)
"""[rad] a differential base that looks past its goal by less drives."""
GAIN = 4.0
"""[1/s] of what is left, near the goal."""
BACKWARDS = 0.3
"""[m] what lies behind a differential base and is not further away is reached backwards."""

HELD_UP = 75
"""Control steps in which a base that is not at its goal has neither come nearer nor turned: something holds it."""

_BASES: PerEnv[tuple[str, str, str, str], "Base"] = PerEnv()


class Pace(NamedTuple):
    """How fast a base goes: [m/s], [rad/s], and how it brakes [m/s^2], [rad/s^2]."""

    speed: float = 0.6
    rate: float = 1.2
    braking: float = 0.4
    turn_braking: float = 1.0


class Base(Mover):
    """The base of a robot in all envs.

    Attributes:
        frame: the frame that is moved.
        target: (N, 3) where it is to go: x, y [m] and yaw [rad] in the world.
        sideways: bool, whether it moves to all sides while it turns.
        pace: how fast.
        close: [m] from there the rest of the way is not worth another turn.
        no_way: (N,) bool, whether its planner has found none.
        held_up: control steps in which it neither comes nearer nor turns, after which something holds it.
    """

    drives: ClassVar[tuple[tuple[str, ...], ...]] = (HOLONOMIC, DIFFERENTIAL)
    planned: ClassVar[bool] = False

    def __init__(self, env: TaskEnv, robot: RobotView, channel: str, link: str) -> None:
        self.env = env
        self._slice = env.actions.slice_of(robot.name, channel)
        self.frame = env.scene.frame(f"{robot.name}.{link}") if link else robot.base
        moved = self._slice.controller.robot.root
        if not link and moved != env.engine.index.entity(robot.name).root:  # under a planar base the rail stays
            self.frame = env.scene.frame(env.engine.world.bodies[moved].name)
        labels = tuple(self._slice.controller.labels)
        if labels not in self.drives:
            known = listing([f"({', '.join(names)})" for names in self.drives])
            raise TaskError(
                f"the base of '{robot.name}' takes ({', '.join(labels)}) by the controller of '{channel}'; expected "
                f"one of {known}, as of holonomic_drive, planar_drive and differential_drive"
            )
        self.sideways = labels == HOLONOMIC
        self.target, self.no_way = np.zeros((env.num_envs, 3)), np.zeros(env.num_envs, dtype=bool)
        self.pace, self.close, self.held_up = Pace(), 0.01, HELD_UP
        self._fresh = np.ones(env.num_envs, dtype=bool)
        self._mode = np.zeros(env.num_envs, dtype=np.int64)
        self._ahead = np.ones(env.num_envs)
        """(N,) 1 where the base drives forwards, -1 backwards."""

    @classmethod
    def of(cls, env: TaskEnv, robot: RobotView, *, channel: str = "base", link: str = "", planner: str = "") -> Self:
        """The base of an env, shared by all skills that drive it by the same planner, if by any.

        Raises:
            TaskError: the channel has no controller, or one that drives no base.
        """
        kind = registry.load("planners", planner) if planner else cls
        made = _BASES.of(env, (robot.name, channel, link, planner), lambda: kind(env, robot, channel, link))
        return made  # pyright: ignore[reportReturnType]

    @staticmethod
    def driven(env: TaskEnv, robot: RobotView) -> "Base | None":
        """The base of a robot that a skill of the env drives, if there is one."""
        return next((base for (name, *_), base in _BASES.known(env).items() if name == robot.name), None)

    def foresee(self, movers: Sequence[str]) -> None:
        """Go around entities that move by themselves as well, as they go on; a planner does."""
        raise TaskError(f"movers ({listing(movers)}) are foreseen by a planner; add `planner: dynamic_window`")

    def renew(self, ids: Array) -> None:
        """These envs have just been reset."""
        self._fresh[ids] = True

    def prepare(self, ids: Array) -> None:
        """Stay where the base is, in envs that have been reset; the scene looks at `ids`."""
        fresh = self._fresh[ids]
        if fresh.any():
            self.target[ids[fresh]] = self.pose(np.flatnonzero(fresh))
            self._mode[ids[fresh]] = ROUND
            self._fresh[ids] = False

    def pose(self, at: Array) -> Array:
        """(n, 3) x, y [m] and yaw [rad]; `at` are rows of the scene."""
        pose = self.frame.pose[at]
        return np.concatenate([pose[:, :2], P.yaw(pose[:, 3:])[:, None]], axis=1)

    def go(self, ids: Array, target: Array) -> None:
        """Go to x, y, yaw (n, 3)."""
        self.target[ids], self._mode[ids] = target, TOWARDS

    def left(self, ids: Array, at: Array) -> tuple[Array, Array]:
        """(n,) [m] and (n,) [rad] that are left of the way."""
        now, target = self.pose(at), self.target[ids]
        return P.norm(target[:, :2] - now[:, :2]), np.abs(P.wrapped(target[:, 2] - now[:, 2]))

    def way_lengths(self, ids: Array, at: Array, places: Array) -> Array:
        """(n, C) [m] of the ways to places (n, C, 2 or more): straight, or by a planner, inf where there is none."""
        del ids
        return P.norm(places[..., :2] - self.pose(at)[:, None, :2])

    def speed(self, at: Array) -> tuple[Array, Array]:
        """(n,) [m/s] over the ground and (n,) [rad/s] about the vertical."""
        twist = self.frame.twist[at]
        return P.norm(twist[:, :2]), np.abs(twist[:, 5])

    def act(self, ids: Array, action: Array) -> None:
        """Write the action of these envs, which the scene looks at."""
        now = self.pose(np.arange(len(ids)))
        way = self.target[ids, :2] - now[:, :2]
        turn = P.wrapped(self.target[ids, 2] - now[:, 2])
        cosine, sine = np.cos(now[:, 2]), np.sin(now[:, 2])
        forward, aside = cosine * way[:, 0] + sine * way[:, 1], cosine * way[:, 1] - sine * way[:, 0]
        drive = self._straight if self.sideways else self._turning
        action[ids, self._slice.start : self._slice.stop] = drive(ids, forward, aside, turn)

    def _straight(self, ids: Array, forward: Array, aside: Array, turn: Array) -> Array:
        del ids
        distance = np.hypot(forward, aside)
        share = self._velocity(distance) / np.maximum(distance, 1e-9)
        return np.stack([share * forward, share * aside, self._rate(turn)], axis=1)

    def _turning(self, ids: Array, forward: Array, aside: Array, turn: Array) -> Array:
        distance, mode = np.hypot(forward, aside), self._mode[ids]
        far = distance > self.close
        fresh = (mode == TOWARDS) & far
        behind = (forward < 0) & (distance < BACKWARDS)
        self._ahead[ids[fresh]] = np.where(behind, -1.0, 1.0)[fresh]
        ahead = self._ahead[ids]
        bearing = np.arctan2(ahead * aside, ahead * forward)
        mode = np.where(fresh & (np.abs(bearing) < ALIGNED), ALONG, mode)
        mode = np.where((mode == TOWARDS) & ~far, ROUND, mode)
        passed = (mode == ALONG) & (ahead * forward < 0.25 * self.close)
        mode = np.where(passed, np.where(far, TOWARDS, ROUND), mode)
        self._mode[ids] = mode
        steer = np.where(distance > 0.1, GAIN * np.clip(bearing, -0.3, 0.3), 0.0)
        speed = np.where(mode == ALONG, ahead * self._velocity(np.maximum(ahead * forward, 0.0)), 0.0)
        rate = np.where(mode == ALONG, steer, self._rate(np.where(mode == TOWARDS, bearing, turn)))
        return np.stack([speed, rate], axis=1)

    def _velocity(self, distance: Array) -> Array:
        braking = np.sqrt(2 * self.pace.braking * distance)
        return np.minimum(np.minimum(self.pace.speed, braking), GAIN * distance)

    def _rate(self, angle: Array) -> Array:
        size = np.abs(angle)
        braking = np.sqrt(2 * self.pace.turn_braking * size)
        return np.sign(angle) * np.minimum(np.minimum(self.pace.rate, braking), GAIN * size)

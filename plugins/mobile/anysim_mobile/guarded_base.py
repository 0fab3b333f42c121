"""A base that stops in time for a person who steps into its way, and goes on once that is free: the planner `guarded`.

It goes straight, as a base without a planner does. In each control step it looks at the discs of the people that are
watched, as they were some control steps ago, and stands still while one of them is, or will be, in the strip ahead of
it as far as it needs to stop. It sees people by their state and not by a sensor; `latency` is what a sensor would take.
"""

from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim_mobile.separation import Near, Separation
from anysim_skills.moving.base import Base

GOES_ON = 0.3
"""[s] that the way has been free before it goes on."""
SIDE = 0.1
"""[m] beside the robot that count as its way; twice that until it goes on."""
SLOW = 0.02
"""[m/s] below which a velocity has no direction."""


def stopping_distance(speed: Array, braking: float, latency: float) -> Array:
    """(...) [m] that a base goes on from speeds (...) [m/s]: for a latency [s], then braking [m/s^2] to a stop."""
    return speed * latency + speed**2 / (2.0 * braking)


class Watch(NamedTuple):
    """How a guarded base looks out.

    Attributes:
        latency: control steps between what it sees and what it does.
        clear: [m] that is left between it and a person when it has stopped.
        braking: [m/s^2] with which its controller brakes.
    """

    latency: int = 0
    clear: float = 0.5
    braking: float = 0.7


class GuardedBase(Base):
    """A base that is told whom to watch.

    Attributes:
        held: (N,) bool, where it stands still for somebody.
        watch: how it looks out.
    """

    guards: ClassVar[bool] = True

    def __init__(self, env: TaskEnv, robot: RobotView, channel: str, link: str) -> None:
        super().__init__(env, robot, channel, link)
        self._robot, self.watch = robot, Watch()
        self._separation = Separation(env.scene, robot, ())
        n = env.num_envs
        self.held, self._since = np.zeros(n, dtype=bool), np.zeros(n, dtype=np.int64)
        self._step = env.engine.world.physics.control_dt
        self._seen = np.zeros((n, 1, 2, 0, 2))
        """(N, latency + 1, 2, D, 2) places and velocities of the discs, the latest last."""

    def look_out(self, people: Sequence[str], watch: Watch) -> None:
        """Watch these entities from now on."""
        self._separation, self.watch = Separation(self.env.scene, self._robot, people), watch
        self._seen = np.full((self.env.num_envs, watch.latency + 1, 2, self._separation.count, 2), np.nan)

    def renew(self, ids: Array) -> None:
        super().renew(ids)
        self.held[ids], self._since[ids], self._seen[ids] = False, 0, np.nan

    def act(self, ids: Array, action: Array) -> None:
        super().act(ids, action)
        if not self._separation.count:
            return
        at = np.arange(len(ids))
        fresh = np.isnan(self._seen[ids, -1, 1]).any(axis=(1, 2))
        now = np.stack(self._separation.places(), axis=1)
        self._seen[ids[fresh]] = now[fresh, None]  # as an episode begins
        self._seen[ids] = np.concatenate([self._seen[ids, 1:], now[:, None]], axis=1)
        near = self._separation.seen_from(self._seen[ids, 0, 0], self._seen[ids, 0, 1])
        blocked = self._blocked(ids, at, near, action[ids, self._slice.start : self._slice.stop])
        self._since[ids] = np.where(blocked, 0, self._since[ids] + 1)
        self.held[ids] = blocked | (self.held[ids] & (self._since[ids] * self._step < GOES_ON))
        action[ids[self.held[ids]], self._slice.start : self._slice.stop] = 0.0

    def _blocked(self, ids: Array, at: Array, near: Near, wanted: Array) -> Array:
        """(n,) bool: somebody is, or will be, in the way of a base that wants to go on so (n, A)."""
        yaw, twist = self.pose(at)[:, 2], self.frame.twist[at]
        c, s = np.cos(yaw), np.sin(yaw)
        now = np.stack([c * twist[:, 0] + s * twist[:, 1], c * twist[:, 1] - s * twist[:, 0]], axis=1)
        told = np.zeros((len(ids), 2))
        told[:, : 2 if self.sideways else 1] = wanted[:, : 2 if self.sideways else 1]
        slow, still = P.norm(now) < SLOW, P.norm(told) < SLOW
        way = np.where(still[:, None], now, told)
        ahead = way / np.maximum(P.norm(way), 1e-9)[:, None]
        aside = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        waits = self.held[ids]
        speed = np.maximum(P.dot(now, ahead), 0.0)
        speed = np.where(waits, np.maximum(speed, self.pace.speed), speed)  # what it would go on with
        seconds = self.watch.latency * self._step + speed / self.watch.braking
        room = self.watch.clear + stopping_distance(speed, self.watch.braking, self.watch.latency * self._step)
        (x0, y0), (x1, y1) = self._separation.low, self._separation.high
        corners = np.array([[x0, y0], [x0, y1], [x1, y0], [x1, y1]])
        front, width = (corners @ ahead.T).max(axis=0), corners @ aside.T
        along, across = (np.einsum("nda,na->nd", near.place, axis) for axis in (ahead, aside))
        comes, goes = (np.einsum("nda,na->nd", near.velocity, axis) for axis in (ahead, aside))
        side = SIDE * np.where(waits, 2.0, 1.0)[:, None]
        later = across + goes * seconds[:, None]
        left = np.minimum(across, later) - near.radius <= width.max(axis=0)[:, None] + side
        right = np.maximum(across, later) + near.radius >= width.min(axis=0)[:, None] - side
        gap = along + np.minimum(comes, 0.0) * seconds[:, None] - near.radius - front[:, None]
        hit = left & right & (along + near.radius > 0.0) & (gap < room[:, None])
        return hit.any(axis=1) & ~(slow & still)

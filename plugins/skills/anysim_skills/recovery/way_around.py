"""Ways around what stands in the way of a base: one place aside, from which it is free to the goal."""

from functools import cached_property

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim_skills.moving.base import Base
from anysim_skills.moving.footprint import Around, Footprint

DIRECTIONS = 24
DISTANCES = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0)
"""[m] from the base to places that are looked at."""
POINTS = 16
"""Of each straight way, at which the base must not overlap anything."""


class WayAround:
    """Finds places aside in all envs."""

    def __init__(self, env: TaskEnv, robot: RobotView, base: Base, channel: str) -> None:
        """What is moved by other channels than `channel` does not count as part of the base."""
        self._env, self._robot, self._base = env, robot, base
        joints = [j for name, other in robot.model.channels.items() if name != channel for j in other.joints]
        self._others = np.array(joints, dtype=np.int64)
        angle = 2 * np.pi / DIRECTIONS * np.arange(DIRECTIONS)
        self._offsets = np.array([[d * np.cos(a), d * np.sin(a)] for d in DISTANCES for a in angle])

    @cached_property
    def _footprint(self) -> Footprint:
        return Footprint(self._env, self._robot, self._base.frame, self._others)

    def find(self, ids: Array, at: Array, goal: Array) -> tuple[Array, Array]:
        """(n, 3) the places with the shortest way to goals (n, 3), x, y and yaw, and (n,) bool: there is one."""
        here, around = self._base.pose(at), self._footprint.look(ids, at)
        place = here[:, None, :2] + self._offsets
        on = goal[:, None, :2] - place
        there = np.concatenate([place, np.arctan2(on[..., 1], on[..., 0])[..., None]], axis=2)
        end = np.broadcast_to(goal[:, None], there.shape)
        free = self._free(around, np.broadcast_to(here[:, None], there.shape), there) & self._free(around, there, end)
        length = np.where(free, P.norm(self._offsets) + P.norm(on), np.inf)
        best = length.argmin(axis=1)
        rows = np.arange(len(ids))
        return there[rows, best], np.isfinite(length[rows, best])

    def _free(self, around: Around, begin: Array, end: Array) -> Array:
        """(n, c) bool: a base overlaps nothing on its straight way between places (n, c, 3).

        One that cannot move sideways looks to where it drives on all of it.
        """
        way, free = end - begin, np.ones(begin.shape[:2], dtype=bool)
        way[..., 2] = P.wrapped(way[..., 2])
        ahead = np.arctan2(way[..., 1], way[..., 0])
        for share in np.linspace(0.0, 1.0, POINTS + 1):
            pose = begin + share * way
            if not self._base.sideways:
                pose[..., 2] = ahead
            free &= self._footprint.free(around, pose)
        return free & self._footprint.free(around, end)

"""Stands: places on the ground, on rings about something, from which an arm on a base reaches it."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim_skills.arm import Arm
from anysim_skills.moving.base import Base
from anysim_skills.moving.footprint import Footprint

DIRECTIONS, RINGS = 16, 4
"""Stands that are looked at: so many about the object, at so many distances."""
DISTANCE = (0.45, 0.75)
"""[m] least and most from there to the base."""
WAY_POINTS = 6
"""Of the straight way to a stand, at which the base must not overlap anything."""
TURN_COST, MISSING_COST = 0.3, 0.5
"""[m/rad], [m]: what a turn, and goals out of reach, count for beside the metres of the way."""


class Stands:
    """The candidate ring of a base with an arm, facing its middle.

    Attributes:
        count: how many they are, C.
        direction: (C,) which of the directions each is in.
    """

    def __init__(self, env: TaskEnv, base: Base, arm: Arm, distance: tuple[float, float] = DISTANCE) -> None:
        self._env, self._base, self._arm = env, base, arm
        self._footprint = Footprint(env, arm.robot, base.frame, arm.chain.joints)
        angle, ring = 2 * np.pi / DIRECTIONS * np.arange(DIRECTIONS), np.linspace(*distance, RINGS)
        self._offsets = np.array([[-r * np.cos(a), -r * np.sin(a), a] for r in ring for a in angle])
        """(C, 3) from the middle to each stand, and its yaw."""
        self.count, self.direction = len(self._offsets), np.tile(np.arange(DIRECTIONS), RINGS)

    def look(self, ids: Array, at: Array, middle: Array, goals: Array) -> tuple[Array, Array]:
        """The stands about places (n, 2 or more) now, x, y and yaw (n, C, 3), and the effort (n, C) of each.

        That is infinite where the base would overlap something there or on its way, which is straight or its planner's,
        or the arm reaches none of `goals` (n, g, m, 7), ways of m tool poses each.
        """
        here = self._base.pose(at)
        stands = np.concatenate([middle[:, None, :2], np.zeros((len(ids), 1, 1))], axis=2) + self._offsets
        way = stands - here[:, None]
        way[..., 2] = P.wrapped(way[..., 2])
        effort = self._base.way_lengths(ids, at, stands) + TURN_COST * np.abs(way[..., 2])
        around, free = self._footprint.look(ids, at), np.ones(effort.shape, dtype=bool)
        for share in np.linspace(0.0, 1.0, WAY_POINTS + 1)[-1 if self._base.planned else 1 :]:
            free &= self._footprint.free(around, here[:, None] + share * way)
        reached = self._reached(ids, at, stands, goals)
        effort += MISSING_COST * (1.0 - reached / goals.shape[1])
        effort[~free | (reached == 0)] = np.inf
        return stands, effort

    def _reached(self, ids: Array, at: Array, stands: Array, goals: Array) -> Array:
        """(n, C) how many of the goals the arm reaches from each stand."""
        frame, chain = self._base.frame.pose[at], self._arm.chain
        root = P.compose(P.inverse(frame), self._env.scene.state.body_pose[ids, chain.root])
        half, height = 0.5 * stands[..., 2], np.broadcast_to(frame[:, None, 2], stands.shape[:2])
        zero = np.zeros_like(half)
        bases = np.stack([stands[..., 0], stands[..., 1], height, zero, zero, np.sin(half), np.cos(half)], axis=-1)
        bases = P.compose(bases, np.broadcast_to(root[:, None], bases.shape))
        shape = (*stands.shape[:2], *goals.shape[1:3])
        targets = np.broadcast_to(goals[:, None], (*shape, 7)).reshape(-1, 7)
        rows = np.broadcast_to(bases[:, :, None, None], (*shape, 7)).reshape(-1, 7)
        seeds = np.broadcast_to(chain.initial, (len(targets), len(chain)))
        keys = np.repeat(self._env.streams.episode_seed[ids], len(targets) // len(ids))
        found = self._arm.solver.solve(targets, rows, seeds.copy(), random_restarts=0, rng_seeds=keys)
        return found.converged.reshape(shape).all(axis=3).sum(axis=2)

"""Approach: drive a base to where its arm can grasp an object."""

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import FIRST_RUNGS, GO_ON, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView, RobotView
from anysim_skills.arm import Arm
from anysim_skills.choice import Choice
from anysim_skills.grasping.banked import before
from anysim_skills.grasping.candidates import TOP_DOWN, from_above
from anysim_skills.moving.base import wrapped
from anysim_skills.moving.footprint import Footprint
from anysim_skills.moving.navigate import DriveTo

DIRECTIONS, RINGS = 16, 4
"""Stands that are looked at: so many about the object, at so many distances."""
HOVER = 0.1
"""[m] above a grasp, where it is reached as well."""
WAY_POINTS = 6
"""Of the straight way to a stand, at which the base must not overlap anything."""
TURN_COST, MISSING_COST = 0.3, 0.5
"""[m/rad], [m]: what a turn, and grasps out of reach, count for beside the metres of the way."""


class Approach(DriveTo):
    """Drive the base of `robot` to where its arm can grasp `object` from above, facing it, and stop.

    Of stands on rings about the object those are left where the arm reaches a grasp and what is above it, and where the
    base overlaps nothing, on its straight way neither; the one with the shortest way and the most grasps is taken. The
    next one is tried where the base is held up, or no grasp is in reach of where it has stopped. It fails with
    `unreachable_base` where none is left.
    """

    first_rungs: ClassVar[Mapping[Outcome, Rung]] = {**FIRST_RUNGS, Outcome.UNREACHABLE_BASE: Rung.CANDIDATE}

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        tool: str = "tool",
        solver: str = "numba_ik",
        distance: Annotated[
            tuple[float, float], Field(description="[m] least and most from the object to the base")
        ] = (0.45, 0.75),
        carried: Annotated[tuple[str, ...], Field(description="tools of other arms on the base")] = (),
        **options: object,
    ) -> None:
        super().__init__(env, robot=robot, carried=(tool, *carried), solver=solver, **options)  # pyright: ignore
        self._arm, self._object = Arm.of(env, robot, tool=tool, solver=solver), object
        self._footprint = Footprint(env, robot, self.base.frame, self._arm.chain.joints)
        angle, ring = 2 * np.pi / DIRECTIONS * np.arange(DIRECTIONS), np.linspace(*distance, RINGS)
        self._offsets = np.array([[-r * np.cos(a), -r * np.sin(a), a] for r in ring for a in angle])
        """(C, 3) from the object to each stand, and its yaw."""
        n, count = env.num_envs, len(self._offsets)
        self._choice = Choice(n, count)
        self._stands, self._effort = np.zeros((n, count, 3)), np.zeros((n, count))
        self._known = np.zeros(n, dtype=bool)

    def start(self, env_ids: Array) -> None:
        super().start(env_ids)
        self._choice.again(env_ids)
        self._known[env_ids] = False

    def retry(self, rung: Rung, env: int) -> int | None:
        if not self._known[env] or not self._choice.next(env):
            return None
        return 0 if rung is Rung.BACK_OFF else 1

    def wanted_stand(self, ids: Array, at: Array) -> Array:
        fresh = ~self._known[ids]
        if fresh.any():
            self._look_around(ids[fresh], at[fresh])
        return self._stands[ids, self._choice.choose(ids, self._effort[ids])]

    def _drive(self, ids: Array, at: Array) -> Array:
        return np.where(self._choice.none_left(ids), _UNREACHABLE, super()._drive(ids, at))

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        """A grasp is in reach of where the base has come to stand."""
        grasps = from_above(self._object.root.pose[at])
        return np.where(np.isfinite(self._arm.reach(env_ids, grasps)[1]).any(axis=1), GO_ON, _UNREACHABLE)

    def _look_around(self, ids: Array, at: Array) -> None:
        thing, here = self._object.root.pose[at], self.base.pose(at)
        stands = np.concatenate([thing[:, None, :2], np.zeros((len(ids), 1, 1))], axis=2) + self._offsets
        way = stands - here[:, None]
        way[..., 2] = wrapped(way[..., 2])
        effort = P.norm(way[..., :2]) + TURN_COST * np.abs(way[..., 2])
        around, free = self._footprint.look(ids, at), np.ones(effort.shape, dtype=bool)
        for share in np.linspace(0.0, 1.0, WAY_POINTS + 1)[1:]:
            free &= self._footprint.free(around, here[:, None] + share * way)
        reached = self._reached(ids, at, stands)
        effort += MISSING_COST * (1.0 - reached / TOP_DOWN)
        effort[~free | (reached == 0) | ~self._object.present[at][:, None]] = np.inf
        self._stands[ids], self._effort[ids], self._known[ids] = stands, effort, True

    def _reached(self, ids: Array, at: Array, stands: Array) -> Array:
        """(n, C) how many grasps the arm reaches from each stand."""
        frame, chain = self.base.frame.pose[at], self._arm.chain
        root = P.compose(P.inverse(frame), self.env.scene.state.body_pose[ids, chain.root])
        half, height = 0.5 * stands[..., 2], np.broadcast_to(frame[:, None, 2], stands.shape[:2])
        zero = np.zeros_like(half)
        bases = np.stack([stands[..., 0], stands[..., 1], height, zero, zero, np.sin(half), np.cos(half)], axis=-1)
        bases = P.compose(bases, np.broadcast_to(root[:, None], bases.shape))
        grasps = from_above(self._object.root.pose[at])
        goals = np.stack([before(grasps, HOVER), grasps], axis=2)[:, None]
        shape = (*stands.shape[:2], *goals.shape[2:4])
        goals = np.broadcast_to(goals, (*shape, 7)).reshape(-1, 7)
        rows = np.broadcast_to(bases[:, :, None, None], (*shape, 7)).reshape(-1, 7)
        seeds = np.broadcast_to(chain.initial, (len(goals), len(chain)))
        keys = np.repeat(self.env.streams.episode_seed[ids], len(goals) // len(ids))
        found = self._arm.solver.solve(goals, rows, seeds.copy(), random_restarts=0, rng_seeds=keys)
        return found.converged.reshape(shape).all(axis=3).sum(axis=2)


_UNREACHABLE = OUTCOMES.index(Outcome.UNREACHABLE_BASE)

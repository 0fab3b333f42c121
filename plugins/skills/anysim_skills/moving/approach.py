"""Approach: drive a base to where its arm can grasp an object."""

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import FIRST_RUNGS, GO_ON, Phase, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView, RobotView
from anysim_skills.arm import Arm
from anysim_skills.choice import Choice
from anysim_skills.grasping.banked import before
from anysim_skills.grasping.candidates import from_above
from anysim_skills.moving.navigate import DriveTo
from anysim_skills.recovery.stands import DISTANCE, Stands

HOVER = 0.1
"""[m] above a grasp, where it is reached as well."""


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
        ] = DISTANCE,
        carried: Annotated[tuple[str, ...], Field(description="tools of other arms on the base")] = (),
        **options: object,
    ) -> None:
        super().__init__(env, robot=robot, carried=(tool, *carried), solver=solver, **options)  # pyright: ignore
        self._arm, self._object = Arm.of(env, robot, tool=tool, solver=solver), object
        self._ring = Stands(env, self.base, self._arm, distance)
        n, count = env.num_envs, self._ring.count
        self._choice = Choice(n, count)
        self._stands, self._effort = np.zeros((n, count, 3)), np.zeros((n, count))
        self._driven, self._tried = np.zeros((2, n, count), dtype=bool)
        """(N, C) stands that were driven to; those in the directions of such ones before it recovered."""
        self._known = np.zeros(n, dtype=bool)

    def start(self, env_ids: Array) -> None:
        super().start(env_ids)
        self._known[env_ids] = self._driven[env_ids] = self._tried[env_ids] = False

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)

    def make_recovery(self) -> Sequence[Phase]:
        """Back, to look around from there: the next stand is in another direction than those that were tried."""
        return (self.stepping_back(), self.stepping_back())

    def recovers(self, env: int, failure: Outcome) -> bool:
        return bool(self._driven[env].any())

    def anew(self, env_ids: Array) -> None:
        super().anew(env_ids)
        for env in env_ids.tolist():
            vain = self._ring.direction[self._driven[env]]
            self._tried[env] = np.isin(self._ring.direction, vain)
        self._known[env_ids] = self._driven[env_ids] = False

    def retry(self, rung: Rung, env: int) -> int | None:
        if not self._known[env] or not self._choice.next(env):
            return None
        return 0 if rung is Rung.BACK_OFF else 1

    def wanted_stand(self, ids: Array, at: Array) -> Array:
        fresh = ~self._known[ids]
        if fresh.any():
            self._look_around(ids[fresh], at[fresh])
        chosen = self._choice.choose(ids, self._effort[ids])
        self._driven[ids, chosen] = np.isfinite(self._effort[ids, chosen])
        return self._stands[ids, chosen]

    def _drive(self, ids: Array, at: Array) -> Array:
        return np.where(self._choice.none_left(ids), _UNREACHABLE, super()._drive(ids, at))

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        """A grasp is in reach of where the base has come to stand."""
        grasps = from_above(self._object.root.pose[at])
        return np.where(np.isfinite(self._arm.reach(env_ids, grasps)[1]).any(axis=1), GO_ON, _UNREACHABLE)

    def _look_around(self, ids: Array, at: Array) -> None:
        thing = self._object.root.pose[at]
        grasps = from_above(thing)
        stands, effort = self._ring.look(ids, at, thing, np.stack([before(grasps, HOVER), grasps], axis=2))
        effort[self._tried[ids] | ~self._object.present[at][:, None]] = np.inf
        self._stands[ids], self._effort[ids], self._known[ids] = stands, effort, True


_UNREACHABLE = OUTCOMES.index(Outcome.UNREACHABLE_BASE)

"""GoUpTo: drive a base up to a thing, face it, and stop within reach of it."""

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import FIRST_RUNGS, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView, RobotView
from anysim_skills.choice import Choice
from anysim_skills.moving.footprint import Footprint
from anysim_skills.moving.navigate import DriveTo

DIRECTIONS, RINGS = 24, 3
"""Stands that are looked at: so many about the object, at so many distances."""
TURN_COST = 0.2
"""[m/rad] what a turn counts for beside the metres of the way."""


class GoUpTo(DriveTo):
    """Drive the base of `robot` to a stand about `object` that faces it, by the shortest way, and stop there.

    Of stands on rings about the object those count where the base overlaps nothing and to which it has a way. The next
    one is tried where the base is held up; it fails with `unreachable_base` where none is left.
    """

    first_rungs: ClassVar[Mapping[Outcome, Rung]] = {
        **FIRST_RUNGS,
        Outcome.UNREACHABLE_BASE: Rung.CANDIDATE,
        Outcome.NO_PATH: Rung.CANDIDATE,
    }

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        distance: Annotated[
            tuple[float, float], Field(description="[m] least and most from the object's origin to the base")
        ] = (0.65, 0.85),
        channel: str = "base",
        **options: object,
    ) -> None:
        super().__init__(env, robot=robot, channel=channel, **options)  # pyright: ignore[reportArgumentType]
        others = [j for name, other in robot.model.channels.items() if name != channel for j in other.joints]
        self._footprint = Footprint(env, robot, self.base.frame, np.array(others, dtype=np.int64))
        angle, rings = 2 * np.pi / DIRECTIONS * np.arange(DIRECTIONS), np.linspace(*distance, RINGS)
        self._offsets = np.array([[-r * np.cos(a), -r * np.sin(a), a] for r in rings for a in angle])
        """(C, 3) from the object to each stand, and its yaw."""
        self._object, n = object, env.num_envs
        self._choice = Choice(n, len(self._offsets))
        self._stands, self._known = np.zeros((n, len(self._offsets), 3)), np.zeros(n, dtype=bool)
        self._effort = np.zeros((n, len(self._offsets)))

    def start(self, env_ids: Array) -> None:
        super().start(env_ids)
        self._known[env_ids] = False

    def forget(self, env_ids: Array) -> None:
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

    def _look_around(self, ids: Array, at: Array) -> None:
        here, thing = self.base.pose(at), self._object.root.position[at]
        stands = np.concatenate([thing[:, None, :2], np.zeros((len(ids), 1, 1))], axis=2) + self._offsets
        turn = np.abs(P.wrapped(stands[..., 2] - here[:, None, 2]))
        effort = self.base.way_lengths(ids, at, stands) + TURN_COST * turn
        effort[~Footprint.free(self._footprint.look(ids, at), stands)] = np.inf
        effort[~self._object.present[at]] = np.inf
        self._stands[ids], self._effort[ids], self._known[ids] = stands, effort, True


_UNREACHABLE = OUTCOMES.index(Outcome.UNREACHABLE_BASE)

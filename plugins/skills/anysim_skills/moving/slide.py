"""Slide: move a held object across its support to a goal, without lifting it, and let go of it."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.arm import Arm
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.grasping.held import RESTING, Moves, PutsDown

LEAD = 0.03
"""[m] of the command before the hand: it bounds the force with which a thing that is in the way is pushed."""
STALLED = 60
"""Control steps in which the object does not get nearer by `PROGRESS` before it counts as jammed."""
PROGRESS = 0.004
"""[m]"""


class Slide(PutsDown):
    """Slide the held `object` to `goal`, horizontally, at the height at which it is held; then let go of it."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        goal: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        tolerance: Metres = 0.01,
        rise: Annotated[float, Field(gt=0, description="[m] that the object may come off its support")] = 0.01,
        slide_speed: Speed = 0.12,
        speed: Speed = 0.4,
        retreat: Metres = 0.1,
        steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 400,
    ) -> None:
        self._goal, self._tolerance, self._rise, self._slide_speed = goal, tolerance, rise, slide_speed
        n = env.num_envs
        self._height, self._left = np.zeros((2, n))
        """(N,) [m] of the object's origin when it is taken; what was left of the way at the last progress."""
        self._since = np.zeros(n, dtype=np.int64)
        arm = Arm.of(env, robot, tool=tool, solver=solver)
        super().__init__(env, arm, object, Moves(speed, slide_speed, retreat, steps))

    def wanted(self, ids: Array, at: Array, grasps: Array) -> Array:
        """Tool poses (n, g, 1, 7) that have the object at the goal in grasps (n, g, 7)."""
        del ids
        poses = grasps[:, :, None].copy()
        poses[..., :2] += self._to_goal(at)[:, None, None]
        return poses

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("slide", self._begin, self._slide, self.moves.steps), *self.let_go())

    def make_recovery(self) -> Sequence[Phase]:
        """None: home is above the support on which it slides."""
        return ()

    def retry(self, rung: Rung, env: int) -> int | None:
        """None: what is not held any more has to be grasped again."""
        del rung, env
        return None

    def _begin(self, ids: Array, at: Array) -> None:
        self.take(ids, at)
        self._height[ids] = self.object.root.position[at, 2]
        self._left[ids], self._since[ids] = np.inf, 0

    def _to_goal(self, at: Array) -> Array:
        """(n, 2) [m] from the object to the goal."""
        return (self._goal.position[at] - self.object.root.position[at])[:, :2]

    def _slide(self, ids: Array, at: Array) -> Array:
        way, high = self._to_goal(at), self.object.root.position[at, 2] - self._height[ids]
        left = P.norm(way)
        place = self.arm.tool.position[at]
        place[:, :2] += way
        place[:, 2] -= high
        target = np.concatenate([place, self.arm.target[ids, 3:]], axis=1)
        self.arm.go(ids, target, self._slide_speed, LEAD)
        on = left < self._left[ids] - PROGRESS
        self._left[ids] = np.where(on, left, self._left[ids])
        self._since[ids] = np.where(on, 0, self._since[ids] + 1)
        there = (left < self._tolerance) & self.slow(at, RESTING)
        said = np.where(np.abs(high) > self._rise, _UNSTABLE, np.where(self._since[ids] > STALLED, _JAMMED, STAY))
        return self.held(ids, at, np.where(there, GO_ON, said))

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        del env_ids
        return np.where(P.norm(self._to_goal(at)) < 2 * self._tolerance, GO_ON, _LOST)


_UNSTABLE, _JAMMED = OUTCOMES.index(Outcome.UNSTABLE_GRASP), OUTCOMES.index(Outcome.JAMMED)
_LOST = OUTCOMES.index(Outcome.LOST)

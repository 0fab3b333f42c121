"""FlyTrack and Watch: keep a flying camera's eye on what moves, and let what cameras film take its course."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim_cameras.fly_to import Flight

Steps = Annotated[int, Field(ge=1, description="control steps")]


class FlyTrack(Flight):
    """Turn a flying camera to `target`, with the rate of the target fed forward, and keep it so for `steps`."""

    def __init__(self, env: TaskEnv, *, robot: RobotView, target: Frame, steps: Steps = 350) -> None:
        self._target = target
        super().__init__(env, robot, "", 0.0, steps)

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("track", None, self._track, self._late + 1),)

    def _track(self, ids: Array, at: Array) -> Array:
        places = self.eye.joints(ids)[0]
        now = self.eye.local(at, self._target.position[at])
        next_ = self.eye.local(at, self._target.position[at] + self._dt * self._target.twist[at, :3])
        self.eye.angles[ids] = self.eye.towards(places, now)
        ahead = self.eye.towards(places, next_)
        self.eye.swing[ids] = P.wrapped(ahead - self.eye.angles[ids]) / self._dt
        done = np.where(self.steps[ids] >= self._late - 1, GO_ON, STAY)
        return np.where(self._target.present[at], done, _ABSENT)


class Watch(PhasedSkill):
    """Do nothing until `target` has moved and come to rest again, or for `steps`: an event that is filmed.

    It is for worlds whose cameras fly by themselves, and for fixed ones.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        target: Frame | None = None,
        steps: Steps = 250,
        least: Annotated[int, Field(ge=0, description="control steps before anything counts as at rest")] = 25,
        speed: Annotated[float, Field(gt=0, description="[m/s] of what is at rest")] = 0.02,
    ) -> None:
        self._target, self._steps, self._least, self._speed = target, steps, least, speed
        self._still = np.zeros(env.num_envs, dtype=np.int64)
        super().__init__(env)

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("watch", self._begin, self._watch, self._steps + 1),)

    def _begin(self, ids: Array, at: Array) -> None:
        del at
        self._still[ids] = 0

    def _watch(self, ids: Array, at: Array) -> Array:
        if self._target is not None:
            slow = P.norm(self._target.twist[at, :3]) < self._speed
            self._still[ids] = (self._still[ids] + 1) * (slow & (self.steps[ids] >= self._least))
        ended = (self._still[ids] >= _RESTS) | (self.steps[ids] >= self._steps - 1)
        return np.where(ended, GO_ON, STAY)


_RESTS = 10
"""Control steps in a row in which what is at rest is slow."""
_ABSENT = OUTCOMES.index(Outcome.ADVERSE_STATE)

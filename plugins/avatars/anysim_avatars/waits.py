"""Skills that stand still until a person is ready: a hand that reaches out, holds, or is out of the way."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame
from anysim_avatars.hold import GIVEN, HELD
from anysim_avatars.terms import AvatarView, HoldView

Steps = Annotated[int, Field(ge=1, description="control steps in a row for which it is so")]
Patience = Annotated[int, Field(ge=1, description="control steps until it gives up")]


class _Waits(PhasedSkill):
    """Nothing moves until something has been so for some control steps."""

    def __init__(self, env: TaskEnv, steps: int, patience: int) -> None:
        self._steps, self._patience = steps, patience
        self._ready = np.zeros(env.num_envs, dtype=np.int64)
        super().__init__(env)

    @abstractmethod
    def ready(self, ids: Array, at: Array) -> Array:
        """(n,) STAY, GO_ON where it is as it should be, or a failure."""

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("wait", self._begin, self._wait, self._patience),)

    def retry(self, rung: Rung, env: int) -> int | None:
        """None: waiting longer is what `patience` is for."""
        del rung, env

    def _begin(self, ids: Array, at: Array) -> None:
        del at
        self._ready[ids] = 0

    def _wait(self, ids: Array, at: Array) -> Array:
        said = self.ready(ids, at)
        self._ready[ids] = (self._ready[ids] + 1) * (said == GO_ON)
        return np.where((said == GO_ON) & (self._ready[ids] < self._steps), STAY, said)


class AwaitHold(_Waits):
    """Do nothing until a hand of an avatar holds the object of `hold`."""

    def __init__(self, env: TaskEnv, *, hold: HoldView, steps: Steps = 10, patience: Patience = 250) -> None:
        self._hold = hold.family
        super().__init__(env, steps, patience)

    def ready(self, ids: Array, at: Array) -> Array:
        del at
        now = self._hold.holding[ids]
        return np.select([now == HELD, now == GIVEN], [GO_ON, _LOST], STAY)


class AwaitRest(_Waits):
    """Do nothing until `frame` has come to rest at least `moved` from where it was, as what is reached out does."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        frame: Frame,
        moved: Annotated[float, Field(ge=0, description="[m]")] = 0.1,
        speed: Annotated[float, Field(gt=0, description="[m/s]")] = 0.03,
        steps: Steps = 5,
        patience: Patience = 400,
    ) -> None:
        self._frame, self._moved, self._speed = frame, moved, speed
        self._from = np.zeros((env.num_envs, 3))
        super().__init__(env, steps, patience)

    def _begin(self, ids: Array, at: Array) -> None:
        super()._begin(ids, at)
        self._from[ids] = self._frame.position[at]

    def ready(self, ids: Array, at: Array) -> Array:
        far = P.norm(self._frame.position[at] - self._from[ids]) >= self._moved
        return np.where(far & (P.norm(self._frame.twist[at, :3]) < self._speed), GO_ON, STAY)


class AwaitClear(_Waits):
    """Do nothing until all of `avatar` has come to be further than `distance` from `frame`, after it was nearer.

    With `at_once` it need not have been nearer: what is clear now is clear.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        avatar: AvatarView,
        frame: Frame,
        distance: Annotated[float, Field(gt=0, description="[m]")] = 0.2,
        at_once: bool = False,
        steps: Steps = 3,
        patience: Patience = 600,
    ) -> None:
        self._avatar, self._frame, self._distance, self._at_once = avatar, frame, distance, at_once
        self._came = np.zeros(env.num_envs, dtype=bool)
        super().__init__(env, steps, patience)

    def _begin(self, ids: Array, at: Array) -> None:
        super()._begin(ids, at)
        self._came[ids] = self._at_once

    def ready(self, ids: Array, at: Array) -> Array:
        far = self._avatar.gap(self._frame.position)[at] > self._distance
        self._came[ids] |= ~far
        return np.where(far & self._came[ids], GO_ON, STAY)


_LOST = OUTCOMES.index(Outcome.LOST)

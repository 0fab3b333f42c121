"""Track: keep a camera of a robot turned to something that moves."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame
from anysim_skills.moving.look_at import LookAt


class Track(LookAt):
    """Turn `camera` to `target` and keep it within `angle` of the optical axis, for `share` of `duration`.

    The point that is looked at is ahead of a target that moves, by what the joints are behind. It fails with `lost`
    where the target has been further off for longer than `patience`.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        target: Frame,
        angle: Annotated[float, Field(gt=0, description="[rad]")] = 0.1,
        duration: Annotated[int, Field(ge=1, description="control steps, once it looks there")] = 250,
        share: Annotated[float, Field(gt=0, le=1, description="of the duration within `angle`")] = 0.9,
        patience: Annotated[int, Field(ge=1, description="control steps in a row beyond `angle`")] = 50,
        lead: Annotated[float, Field(ge=0, description="[s] ahead of the target")] = 0.2,
        **options: object,
    ) -> None:
        self._duration, self._share, self._patience, self._ahead = duration, share, patience, lead
        self._seen, self._lost = np.zeros((2, env.num_envs), dtype=np.int64)
        super().__init__(env, target=target, angle=angle, **options)  # pyright: ignore[reportArgumentType]

    def make_phases(self) -> Sequence[Phase]:
        return (*super().make_phases(), Phase("follow", self._begin, self._follow, self._duration))

    def point(self, at: Array) -> Array:
        return self._target.position[at] + self._ahead * self._target.twist[at, :3]

    def _begin(self, ids: Array, at: Array) -> None:
        del at
        self._seen[ids] = self._lost[ids] = 0

    def _follow(self, ids: Array, at: Array) -> Array:
        within = self.gaze.angle(ids, self._target.position[at]) < self._angle
        self.gaze.look(ids, self.point(at))
        self._seen[ids] += within
        self._lost[ids] = np.where(within, 0, self._lost[ids] + 1)
        done = np.where(self.steps[ids] >= self._duration - 1, GO_ON, STAY)
        said = np.where(self._lost[ids] > self._patience, _LOST, done)
        return np.where(self._target.present[at], said, _ABSENT)

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        del at
        return np.where(self._seen[env_ids] >= self._share * self._duration, GO_ON, _LOST)


_LOST, _ABSENT = OUTCOMES.index(Outcome.LOST), OUTCOMES.index(Outcome.ADVERSE_STATE)

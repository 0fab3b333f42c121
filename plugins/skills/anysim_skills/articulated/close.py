"""Close: push a drawer, a door or a lid shut, with the open hand astride its handle, or closed on it."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase
from anysim.task.env import TaskEnv
from anysim_skills.articulated.handle import AtHandle, Share

Grip = Annotated[bool, Field(description="fingers close on the handle, as on one that slides across the hand")]


class Close(AtHandle):
    """Close `part` with `robot`: the fingers astride its handle push until it is open by at most `fraction`."""

    share = 0.0

    def __init__(self, env: TaskEnv, *, fraction: Share = 0.03, grip: Grip = False, **options: object) -> None:
        self._fraction, self._holds = fraction, grip
        super().__init__(env, **options)  # pyright: ignore[reportArgumentType]

    def make_phases(self) -> Sequence[Phase]:
        push = (Phase("push", self.take, self._push, 3 * self.late), *self.phases_away())
        return (*self.approach_phases(), *((self.closing_phase(),) if self._holds else ()), *push)

    def excluded(self, grasps: Array) -> Array | None:
        """None where it pushes with what it touches."""
        return super().excluded(grasps) if self._holds else None

    def depth(self, ids: Array) -> Array:
        return np.full(len(ids), 0.0 if self._holds else 0.02)  # the finger tips come close to the front

    def _push(self, ids: Array, at: Array) -> Array:
        self.follow(ids, at)
        self.arm.closed[ids] = self._holds
        said = np.where(self.jammed(ids, at), _JAMMED, STAY)
        return np.where(self.part.joint.opening[at] <= self._fraction, GO_ON, said)

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        return np.where(self.part.joint.opening[at] <= self._fraction + 0.02, GO_ON, _MISSED)


_JAMMED, _MISSED = OUTCOMES.index(Outcome.JAMMED), OUTCOMES.index(Outcome.MISSED_CONTACT)

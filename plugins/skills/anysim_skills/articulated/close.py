"""Close: push a drawer, a door or a lid shut, with the open hand astride its handle."""

from collections.abc import Sequence

import numpy as np

from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase
from anysim.task.env import TaskEnv
from anysim_skills.articulated.handle import AtHandle, Share


class Close(AtHandle):
    """Close `part` with `robot`: the fingers astride its handle push until it is open by at most `fraction`."""

    def __init__(self, env: TaskEnv, *, fraction: Share = 0.03, beyond: Share = 0.0, **options: object) -> None:
        """`beyond` is how much further the hand is sent: fingers lag behind a bar that slides across them."""
        self._fraction, self.share = fraction, -beyond
        super().__init__(env, **options)  # pyright: ignore[reportArgumentType]

    def make_phases(self) -> Sequence[Phase]:
        return (*self.approach_phases(), Phase("push", self.take, self._push, 3 * self.late), *self.phases_away())

    def excluded(self, grasps: Array) -> None:
        """None: it pushes with what it touches."""

    def depth(self, ids: Array) -> Array:
        return np.full(len(ids), 0.02)  # the finger tips come close to the front

    def _push(self, ids: Array, at: Array) -> Array:
        self.follow(ids, at)
        self.arm.closed[ids] = False
        shut = self.part.joint.opening[at] <= self._fraction
        return np.where(shut, GO_ON, np.where(self.jammed(ids, at), _JAMMED, STAY))

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        return np.where(self.part.joint.opening[at] <= self._fraction + 0.02, GO_ON, _MISSED)


_JAMMED = OUTCOMES.index(Outcome.JAMMED)
_MISSED = OUTCOMES.index(Outcome.MISSED_CONTACT)

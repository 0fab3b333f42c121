"""Open: pull a drawer, a door or a lid open by its handle."""

from collections.abc import Sequence

import numpy as np

from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase
from anysim.task.env import TaskEnv
from anysim_skills.articulated.handle import AtHandle, Share
from anysim_skills.grasping.banked import BankFile, CountsFolder, Pinned
from anysim_skills.grasping.grasp import Force

SLIP = 0.04
"""[m] a hand that is further than this from where it took hold of the part has lost it."""
OVERSHOOT = 0.05
"""Of the range: how much further the hand is commanded than asked, so that a drive's yielding does not fall short."""


class Pulls(AtHandle):
    """A skill that pulls a part open to the share `_fraction` of its range."""

    _fraction: float

    def make_phases(self) -> Sequence[Phase]:
        return (
            *self.approach_phases(),
            self.closing_phase(),
            Phase("pull", self.take, self._pull, 3 * self.late),
            *self.phases_away(),
        )

    def _pull(self, ids: Array, at: Array) -> Array:
        slip = self.follow(ids, at)
        opened = self.part.joint.opening[at] >= self._fraction
        said = np.where(self.jammed(ids, at), _JAMMED, np.where(slip > self.lead + SLIP, _UNSTABLE, STAY))
        return np.where(opened, GO_ON, said)

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        return np.where(self.part.joint.opening[at] >= self._fraction - 0.02, GO_ON, _MISSED)


class Open(Pulls):
    """Open `part` with `robot` by its handle, up to a share of its range."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        fraction: Share = 0.8,
        bank: BankFile = None,
        living: CountsFolder = None,
        pinned: Pinned = "",
        force: Force = None,
        **options: object,
    ) -> None:
        self._fraction = fraction
        self.share = min(1.0, fraction + OVERSHOOT)
        self.force = force
        super().__init__(env, bank, living, pinned, **options)  # pyright: ignore[reportArgumentType]


_JAMMED = OUTCOMES.index(Outcome.JAMMED)
_UNSTABLE, _MISSED = OUTCOMES.index(Outcome.UNSTABLE_GRASP), OUTCOMES.index(Outcome.MISSED_CONTACT)

"""Take hold: close the gripper on the handle of a part, and keep hold of it."""

from collections.abc import Sequence

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, Phase
from anysim_skills.articulated.handle import AtHandle

NEAR = 0.03
"""[m] a hand that is further from the handle than this has not got hold of it."""


class TakeHold(AtHandle):
    """Close the gripper of `robot` on the handle of `part` and keep hold of it, so that what comes next moves it."""

    def make_phases(self) -> Sequence[Phase]:
        return (*self.approach_phases(), self.closing_phase())

    def to_go(self, at: Array) -> Array:
        return np.zeros(len(at))

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        del env_ids
        away = P.norm(self.arm.tool.position[at] - self.handle.position[at])
        return np.where(away < NEAR, GO_ON, _MISSED)


_MISSED = OUTCOMES.index(Outcome.MISSED_CONTACT)

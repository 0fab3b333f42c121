"""Take hold: close the gripper on the handle of a part, and keep hold of it."""

from collections.abc import Sequence

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, Phase
from anysim.task.env import TaskEnv
from anysim_skills.articulated.handle import AtHandle
from anysim_skills.grasping.banked import BankFile, CountsFolder, Pinned
from anysim_skills.grasping.grasp import Force

NEAR = 0.03
"""[m] a hand that is further from the handle than this has not got hold of it."""


class TakeHold(AtHandle):
    """Close the gripper of `robot` on the handle of `part` and keep hold of it, so that what comes next moves it."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        bank: BankFile = None,
        living: CountsFolder = None,
        pinned: Pinned = "",
        force: Force = None,
        **options: object,
    ) -> None:
        self.force = force
        super().__init__(env, bank, living, pinned, **options)  # pyright: ignore[reportArgumentType]

    def make_phases(self) -> Sequence[Phase]:
        return (*self.approach_phases(), self.closing_phase())

    def to_go(self, at: Array) -> Array:
        return np.zeros(len(at))

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        away = P.norm(self.arm.tool.position[at] - self.at_handle(env_ids, at, 0.0)[:, :3])
        return np.where(away < NEAR, GO_ON, _MISSED)


_MISSED = OUTCOMES.index(Outcome.MISSED_CONTACT)

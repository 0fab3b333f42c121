"""Open: pull a drawer, a door or a lid open by its handle, or by a lever that draws its latch."""

from collections.abc import Sequence
from functools import partial
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase
from anysim.task.env import TaskEnv
from anysim.task.joints import RangedJointView
from anysim_skills.articulated.handle import AtHandle, Share, along
from anysim_skills.articulated.part import Part
from anysim_skills.grasping.banked import BankFile, CountsFolder, Pinned
from anysim_skills.grasping.grasp import Force

SLIP = 0.04
"""[m] a hand that is further than this from where it took hold of the part has lost it."""
OVERSHOOT = 0.05
"""Of the range: how much further the hand is commanded than asked, so that a drive's yielding does not fall short."""

FREE = 0.02
"""Of the range: a part that is further open than this has left its latch."""

LEVEL = 0.05
"""Of its range, within which a lever counts as back where it was."""


class Pulls(AtHandle):
    """A skill that pulls a part open to the share `_fraction` of its range."""

    _fraction: float

    def make_phases(self) -> Sequence[Phase]:
        return (
            *self.approach_phases(),
            self.closing_phase(),
            Phase("pull", self.take, partial(self.pull, to=self._fraction), 3 * self.late),
            *self.phases_away(),
        )

    def pull(self, ids: Array, at: Array, to: float) -> Array:
        """Until the part is open by the share `to`."""
        slip = self.follow(ids, at)
        opened = self.part.joint.opening[at] >= to
        said = np.where(self.jammed(ids, at), _JAMMED, np.where(slip > self.lead + SLIP, _UNSTABLE, STAY))
        return np.where(opened, GO_ON, said)

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        return np.where(self.part.joint.opening[at] >= self._fraction - 0.02, GO_ON, _MISSED)


class Open(Pulls):
    """Open `part` with `robot` by its handle, up to a share of its range.

    Where there is a `lever` on the part, it is what the hand closes on: it is turned up to the share `turned` of its
    range, and let up again once the part has left its latch.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        fraction: Share = 0.8,
        lever: RangedJointView | None = None,
        turned: Annotated[float, Field(ge=0, le=1, description="of the range of the lever")] = 0.8,
        bank: BankFile = None,
        living: CountsFolder = None,
        pinned: Pinned = "",
        force: Force = None,
        **options: object,
    ) -> None:
        self._fraction, self._turned = fraction, turned
        self.share = min(1.0, fraction + OVERSHOOT)
        self.force = force
        self._lever = None if lever is None else Part(env.scene, lever)
        super().__init__(env, bank, living, pinned, **options)  # pyright: ignore[reportArgumentType]

    def make_phases(self) -> Sequence[Phase]:
        phases = super().make_phases()
        if self._lever is None:
            return phases
        pull = [phase.name for phase in phases].index("pull")
        take = partial(self.go_with, self._lever)
        return (
            *phases[:pull],
            Phase("turn", take, partial(self._turn_lever, self._lever), self.late),
            Phase("draw", self.take, partial(self.pull, to=min(FREE, self._fraction)), self.late),
            Phase("let up", take, partial(self._let_up, self._lever), self.late),
            *phases[pull:],
        )

    def held_part(self) -> Part:
        return self._lever or self.part

    def stations(self, at: Array, grasps: Array) -> Array:
        """Round with the lever, and with the part from there."""
        if self._lever is None:
            return super().stations(at, grasps)
        lever = self._lever
        turning = along(lever, at, grasps, lever.closed + self._turned * lever.span - lever.position(at))
        return np.concatenate([turning, super().stations(at, turning[:, :, -1])], axis=2)

    def _turn_lever(self, lever: Part, ids: Array, at: Array) -> Array:
        share = min(1.0, self._turned + OVERSHOOT)
        slipped = self.follow(ids, at, lever, share) > self.lead + SLIP
        said = np.where(self.jammed(ids, at, lever, share), _JAMMED, np.where(slipped, _UNSTABLE, STAY))
        free = (lever.joint.opening[at] >= self._turned) | (self.part.joint.opening[at] > FREE)
        return np.where(free, GO_ON, said)

    def _let_up(self, lever: Part, ids: Array, at: Array) -> Array:
        """Back with the lever as far as it goes: its spring presses it out of fingers that pull for long.

        And fingers that are turned are hooked behind it when they leave.
        """
        self.follow(ids, at, lever, 0.0)
        up = lever.joint.opening[at] < LEVEL
        return np.where(up | self.jammed(ids, at, lever, 0.0) | (self.steps[ids] >= self.late - 1), GO_ON, STAY)


_JAMMED = OUTCOMES.index(Outcome.JAMMED)
_UNSTABLE, _MISSED = OUTCOMES.index(Outcome.UNSTABLE_GRASP), OUTCOMES.index(Outcome.MISSED_CONTACT)

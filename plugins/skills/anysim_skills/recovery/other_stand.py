"""OtherStand: another place for the base below an arm that has failed where it stands."""

from collections.abc import Callable

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill
from anysim_skills.arm import Arm
from anysim_skills.moving.base import Base
from anysim_skills.recovery.stands import Stands

Ways = Callable[[Array, Array], Array]
"""Tool poses (n, g, m, 7) of g ways to do it, of envs and their rows in the scene."""
ELSEWHERE = 0.15
"""[m] from where the base stands another stand is at least."""
NEAR, TURNED, SLOW = 0.02, 0.035, 0.02
"""[m], [rad] from a stand, and [m/s, rad/s], at which the base has arrived."""
STEPS = 600


class OtherStand:
    """Drives the base below `arm` to the stand of the candidate ring, about the middle of the ways, with least effort.

    The arm rides along in the posture it began in. Nothing is done where no skill of the env drives the base.
    """

    def __init__(self, skill: PhasedSkill, arm: Arm, ways: Ways) -> None:
        self._skill, self._arm, self._ways = skill, arm, ways
        self._base: Base | None = None
        self._stands: Stands | None = None

    def phase(self) -> Phase:
        """The phase in which that is done."""
        return Phase("other stand", self._choose, self._drive, STEPS + 1)

    def _choose(self, ids: Array, at: Array) -> None:
        if self._stands is None and (base := Base.driven(self._skill.env, self._arm.robot)) is not None:
            self._base, self._stands = base, Stands(self._skill.env, base, self._arm)
        if self._base is None or self._stands is None:
            return
        ways, here = self._ways(ids, at), self._base.pose(at)
        stands, effort = self._stands.look(ids, at, ways[..., :2].mean(axis=(1, 2)), ways)
        effort[P.norm(stands[..., :2] - here[:, None, :2]) < ELSEWHERE] = np.inf
        rows, best = np.arange(len(ids)), effort.argmin(axis=1)
        found = np.isfinite(effort[rows, best])[:, None]
        self._base.go(ids, np.where(found, stands[rows, best], here))

    def _drive(self, ids: Array, at: Array) -> Array:
        base = self._base
        if base is None:
            return np.full(len(ids), GO_ON)
        self._arm.turn_to(ids, np.broadcast_to(self._arm.chain.initial, (len(ids), len(self._arm.chain))))
        (left, turn), (speed, rate) = base.left(ids, at), base.speed(at)
        there = (left < NEAR) & (turn < TURNED) & (speed < SLOW) & (rate < SLOW)
        return np.where(there | (self._skill.steps[ids] >= STEPS), GO_ON, STAY)

"""Grasp of matter by one of its pads: a hand comes down on a point of it, closes, and lifts it."""

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim_skills.arm import Arm

CLOSING = 40
"""Control steps that a hand may take to close."""
RESTING = 0.002
"""[rad/s, m/s] of its fingers, below which they rest."""


class PadGrasp(PhasedSkill):
    """The hand is turned as it is at home; missed once, again. It fails with `no_ik` where the arm does not reach."""

    def __init__(self, env: TaskEnv, arm: Arm, *, above: float, hover: float, lift: float, speed: float) -> None:
        """`above` [m] the point the hand closes, `hover` [m] above it it is first; it lifts by `lift` [m]."""
        arm.check_gripper()
        self.arm = arm
        self._above, self._hover, self._lift, self._speed = above, hover, lift, speed
        super().__init__(env, [arm])

    @abstractmethod
    def point(self, ids: Array, at: Array, above: float) -> Array:
        """(n, 3) [m] where the hand is that is so far above what it takes hold of."""

    @abstractmethod
    def has(self, ids: Array, at: Array) -> Array:
        """(n,) bool: the hand that closes has it."""

    @abstractmethod
    def keeps(self, at: Array) -> Array:
        """(n,) bool: the hand that lifts still has it."""

    @property
    def patient(self) -> bool:
        """Whether pads may take hold after the fingers have come to rest."""
        return False

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("reach", self._open, self._reach, 1),
            Phase("approach", None, self._approach, 300),
            Phase("descend", None, self._descend, 150),
            Phase("close", self._close, self._closing, CLOSING + 1),
            Phase("lift", self._raise, self._rising, 150),
        )

    def retry(self, rung: Rung, env: int) -> int | None:
        return 0 if rung in (Rung.REPLAN, Rung.RESAMPLE) else None

    def _over(self, ids: Array, at: Array, above: float) -> Array:
        """(n, 7) the hand so far above the point."""
        return np.column_stack([self.point(ids, at, above), self.arm.home(ids)[:, 3:]])

    def _open(self, ids: Array, at: Array) -> None:
        del at
        self.arm.closed[ids] = False

    def _reach(self, ids: Array, at: Array) -> Array:
        ways = np.stack([self._over(ids, at, above) for above in (self._hover, self._above)], axis=1)
        return np.where(np.isfinite(self.arm.effort(ids, ways)), GO_ON, _NO_IK)

    def _approach(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._over(ids, at, self._hover), self._speed)
        return np.where(self.arm.arrived(ids, at, 0.01, 0.08), GO_ON, STAY)

    def _descend(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._over(ids, at, self._above), self._speed / 2)
        return np.where(self.arm.arrived(ids, at, 0.006, 0.08) | self.arm.touching(ids, at), GO_ON, STAY)

    def _close(self, ids: Array, at: Array) -> None:
        del at
        self.arm.closed[ids] = True
        self.arm.stay(ids)

    def _closing(self, ids: Array, at: Array) -> Array:
        held = self.has(ids, at)
        still = (self.steps[ids] >= 10) & (self.arm.finger_speed(ids) < RESTING)
        over = (still & ~held & (not self.patient)) | (self.steps[ids] >= CLOSING)
        return np.where(held & still, GO_ON, np.where(over, _MISSED, STAY))

    def _raise(self, ids: Array, at: Array) -> None:
        del at
        up = np.array([0.0, 0.0, self._lift, 0.0, 0.0, 0.0, 0.0])
        self.arm.go(ids, self.arm.command[ids] + up, self._speed / 2)

    def _rising(self, ids: Array, at: Array) -> Array:
        said = np.where(self.arm.arrived(ids, at, 0.01, 0.1), GO_ON, STAY)
        return np.where(self.keeps(at), said, _UNSTABLE)


_NO_IK, _MISSED = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.MISSED_CONTACT)
_UNSTABLE = OUTCOMES.index(Outcome.UNSTABLE_GRASP)

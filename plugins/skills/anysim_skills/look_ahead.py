"""Looking ahead: of the grasps that can be reached, those with which the arm can go on with what comes next."""

from typing import Protocol

import numpy as np

from anysim.conventions import Array
from anysim.skills.phases import MovingSkill
from anysim_skills.arm import Arm


class TakesOver(Protocol):
    """A skill that goes on with what a grasp holds."""

    def wanted(self, ids: Array, at: Array, grasps: Array) -> Array:
        """As `MovingSkill.wanted`."""
        ...


class LookAhead:
    """What comes next for an arm that grasps or carries something.

    Attributes:
        then: it; None as long as that is not known.
    """

    def __init__(self, arm: Arm, then: TakesOver | None = None) -> None:
        self._arm, self.then = arm, then

    def foresee(self, following: MovingSkill) -> None:
        """A command follows; it counts if it moves the arm."""
        if self.then is None and self._arm in following.movers:
            self.then = following

    def ways(self, ids: Array, at: Array, grasps: Array, own: Array | None = None) -> Array:
        """Tool poses (n, g, c, m, 7): `own` (n, g, m, 7) with grasps (n, g, 7), and those of what comes next."""
        poses = np.zeros((*grasps.shape[:2], 0, 7)) if self.then is None else self.then.wanted(ids, at, grasps)
        ways = poses if poses.ndim == 5 else poses[:, :, None]
        if own is None:
            return ways
        before = np.broadcast_to(own[:, :, None], (*ways.shape[:3], *own.shape[2:]))
        return np.concatenate([before, ways], axis=3)

    def effort(self, ids: Array, at: Array, grasps: Array, effort: Array) -> Array:
        """Efforts (n, g) of grasps (n, g, 7), no less than what comes next needs; infinite where that is out of reach.

        Of several ways to do that the one with the least motion counts.
        """
        ways = self.ways(ids, at, grasps)
        possible = np.isfinite(effort)[:, :, None] & np.isfinite(ways).all(axis=(3, 4))
        cost = np.where(possible, 0.0, np.inf)
        n, g, c = cost.shape
        for station in range(ways.shape[3]):  # only as long as the way was reached so far
            left, poses = np.isfinite(cost).reshape(n, g * c), ways[:, :, :, station].reshape(n, g * c, 7)
            cost = np.maximum(cost, self._arm.reach(ids, poses, where=left)[1].reshape(cost.shape))
        return np.maximum(effort, cost.min(axis=2))

    def passed(self, ids: Array, at: Array, grasps: Array, effort: Array) -> Array:
        """The efforts (n, g) as they are; infinite where what comes next is out of reach."""
        return np.where(np.isinf(self.effort(ids, at, grasps, effort)), np.inf, effort)

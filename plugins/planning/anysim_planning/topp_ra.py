"""The planner of motion `rrt_topp_ra`: as `rrt`, along the same paths in the least time (TOPP-RA).

H. Pham and Q.-C. Pham, "A new approach to time-optimal path parameterization based on reachability analysis", IEEE
Transactions on Robotics 34 (2018).
"""

from typing import NamedTuple, Self

import numpy as np

from anysim.conventions import Array
from anysim_planning.rrt import RrtPlanner
from anysim_planning.time_law import hermite_derivatives

_FLAT = 1e-9
"""Change of a joint along the path that counts as none."""


def reachable_speeds(s: Array, q: Array, first: Array, velocity: Array, acceleration: float) -> Array:
    """Squares x (M,) of the speed along a path, with the least time within limits; `time_law.Speeds` says of what.

    Between two points the acceleration u along the path is constant; it keeps those of all joints, q' u + q'' x, within
    the limit on the whole of their cubic. From the end backward: the largest x at each point from which the end can be
    reached. Forward then: the largest u that stays below it.
    """
    step = float(s[1] - s[0])
    bounds = _Bounds.of(step, q, first, acceleration)
    most = (velocity / np.maximum(np.abs(first), _FLAT)).min(axis=1) ** 2
    most[:-1] = np.minimum(most[:-1], bounds.permitted(step))
    most[[0, -1]] = 0.0
    for i in range(len(most) - 2, 0, -1):
        most[i] = min(most[i], bounds.leading_to(i, most[i + 1], step))
    for i in range(len(most) - 1):
        most[i + 1] = min(most[i + 1], max(most[i] + 2.0 * step * bounds.gain(i, most[i]), 0.0))
    return most


class _Bounds(NamedTuple):
    """Of intervals (M - 1, R): the acceleration u along the path has -reach <= u + fall x <= reach, x at its start."""

    fall: Array
    reach: Array

    @classmethod
    def of(cls, step: float, q: Array, first: Array, acceleration: float) -> Self:
        """Those of the cubics between points.

        A joint's acceleration is quadratic along each: it is within what its three Bernstein coefficients are within.
        """
        along, bent = [], []
        for share in (0.0, 0.5, 1.0):
            slope, bend = hermite_derivatives(q, first, step, share)
            along.append(slope + 2.0 * share * step * bend)  # x has grown by 2 u on the way
            bent.append(bend)
        for values in (along, bent):
            values[1] = 2.0 * values[1] - 0.5 * (values[0] + values[2])
        rows = np.concatenate(along, axis=1)
        size = np.maximum(np.abs(rows), _FLAT)
        return cls(np.concatenate(bent, axis=1) * np.where(rows < 0, -1.0, 1.0) / size, acceleration / size)

    def permitted(self, step: float) -> Array:
        """The largest x (M - 1,) for which there is a u that does not go back before the interval's end."""
        upper = np.concatenate([self.reach, np.zeros((len(self.reach), 1))], axis=1)
        fall = np.concatenate([self.fall, np.full((len(self.fall), 1), 0.5 / step)], axis=1)
        # what is highest of the lower bounds, -upper - fall x, meets what is lowest of the upper ones
        closing = self.fall[:, :, None] - fall[:, None, :]
        apart = self.reach[:, :, None] + upper[:, None, :]
        meeting = np.divide(apart, closing, out=np.full_like(apart, np.inf), where=closing > 0)
        return meeting.min(axis=(1, 2))

    def leading_to(self, i: int, most: float, step: float) -> float:
        """The largest x at the start of an interval that ends with at most this one."""
        closing = 0.5 / step - self.fall[i]
        meeting = np.full_like(closing, np.inf)
        np.divide(0.5 / step * most + self.reach[i], closing, out=meeting, where=closing > 0)
        return float(meeting.min())

    def gain(self, i: int, x: float) -> float:
        """The largest u from x at the start of an interval."""
        return float((self.reach[i] - self.fall[i] * x).min())


class ToppRaPlanner(RrtPlanner):
    """As `rrt`, but as fast along its paths as the limits of velocity and acceleration permit."""

    name = "rrt_topp_ra"
    version = "1"
    speeds = staticmethod(reachable_speeds)

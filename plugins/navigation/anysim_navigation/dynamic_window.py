"""The dynamic window: each tick the best of the velocities that a base can have next, by critics over rollouts."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim_navigation.limits import SAMPLES, BaseKind, BaseLimits
from anysim_navigation.pose_control import in_frame
from anysim_navigation.progress import Progress
from anysim_sensors.states import OCCUPIED

STEP = 0.1
"""[s] of a rollout's steps, and between ticks."""
AIMS = (1.0, 0.8, 0.6, 0.45, 0.3)
"""Shares of its reach at which the point is looked for that a base makes for."""


class Critics(NamedTuple):
    """Weights of what a rollout is scored by, each about 1 at its worst for a metre of the way.

    Attributes:
        path: [1/m] of its end from the way.
        goal: [1/m] of its end from the point of the way that is made for.
        obstacle: how far it is within the margin, and what it would run into later.
        oscillation: for each component that changes its sign.
        velocity: what it is slower than it could be.
        heading: [1/rad] its end looks past the point that is made for.
    """

    path: float = 0.6
    goal: float = 1.0
    obstacle: float = 0.8
    oscillation: float = 0.04
    velocity: float = 0.1
    heading: float = 0.25


HEADINGS: dict[BaseKind, float] = {BaseKind.HOLONOMIC: 0.05, BaseKind.QUADRUPED: 0.15}
"""What heading counts for where it is not the usual weight: who goes sideways need not look ahead."""


class Choice(NamedTuple):
    """What is best now: velocities (3,), their cost (inf where all run into something), and the clearance [m]."""

    twist: Array
    cost: float
    clearance: float


class DynamicWindow:
    """Velocities for one kind of base. It remembers nothing: equal questions have equal answers.

    A rollout that overlaps something within the time that it takes to brake is out, as long as the base does not
    overlap it already: then whatever brings it no nearer is allowed. A smaller distance than `margin` costs.
    """

    def __init__(
        self, limits: BaseLimits, critics: Critics | None = None, *, margin: float = 0.12, horizon: float = 1.6
    ) -> None:
        limits.check()
        if critics is None:
            critics = Critics(heading=HEADINGS.get(limits.kind, Critics().heading))
        self.limits, self.margin = limits, margin
        self._weights, self._samples = np.array(critics, dtype=float), np.array(SAMPLES[limits.kind])
        self._timing = np.array([STEP, horizon, 0.35])
        self.reach = float(limits.high[0]) * horizon
        """[m] as far as a rollout goes: how far ahead the point is that is made for."""

    def ahead(
        self, progress: Progress, pose: Array, field: Array, cell: float, reach: float | None = None
    ) -> tuple[Array, Array]:
        """The way (K, 2) from here on, and the point (2,) of it that is made for, in the frame of the base.

        That is `reach` [m] ahead, else as far as a rollout goes; nearer where the straight line would cut a corner.
        """
        from anysim_navigation.kernels.window import line_is_free

        path, aim = np.zeros((1, 2)), np.zeros(2)
        for share in AIMS:
            path, aim = (in_frame(pose, np.atleast_2d(p)) for p in progress.ahead(share * (reach or self.reach)))
            aim = aim[0]
            if line_is_free(field, float(cell), self.limits.radius, aim[0], aim[1]):
                break
        return path, aim

    def choose(
        self,
        field: Array,
        cell: float,
        path: Array,
        aim: Array,
        now: Array,
        last: Array,
        movers: Array | None = None,
        gear: float = 0.0,
    ) -> Choice:
        """The best velocities, all in the frame of the base.

        Args:
            field: (rows, columns) [m] from each cell to what is occupied, the base at the middle; see `distances_of`.
            cell: [m]
            path: (K, 2) [m] the way ahead.
            aim: (2,) [m] the point on it that is made for.
            now, last: (3,) the velocity, and what was told last.
            movers: (M, 5) x, y, vx, vy and radius of what moves and is not in the field.
            gear: 1 for forwards alone, -1 for backwards alone, 0 for both.
        """
        from anysim_navigation.kernels import window

        limits, out = self.limits, np.zeros(3)
        low, high = limits.low.copy(), limits.high.copy()
        low[0], high[0] = low[0] * (gear <= 0), high[0] * (gear >= 0)
        cost, clearance = window.choose(
            field,
            float(cell),
            limits.discs,
            np.zeros((0, 5)) if movers is None else np.ascontiguousarray(movers),
            np.ascontiguousarray(path),
            np.array(aim, dtype=float),
            np.array(now, dtype=float),
            np.array(last, dtype=float),
            low,
            high,
            limits.acceleration,
            float(limits.turning_radius),
            self._samples,
            self._weights,
            self._timing,
            self.margin,
            out,
        )
        return Choice(out, cost, clearance)


def distances_of(cells: Array, cell: float) -> Array:
    """(rows, columns) [m] from each cell's middle to that of the nearest occupied one of an occupancy scan.

    What is unknown counts as free: it lies behind what is seen, and is seen before a base gets there.
    """
    from scipy.ndimage import distance_transform_edt

    free = cells != OCCUPIED
    if free.all():
        return np.full(cells.shape, 10.0)
    return np.ascontiguousarray(np.asarray(distance_transform_edt(free)) * cell)

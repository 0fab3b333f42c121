"""The beam search: where people walk, the best of what a base can do in the next seconds, with waits and detours."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim_navigation.dynamic_window import STEP
from anysim_navigation.limits import BaseKind, BaseLimits
from anysim_navigation.progress import arcs_of, points_at

SPEEDS = (1.0, 0.5, 0.0, -1.0)
"""Of the fastest forwards and backwards."""
TURNS = (-1.0, -0.4, 0.0, 0.4, 1.0)
"""Of the fastest turn, or of the tightest curve."""
WAYS, PACES = 12, (1.0, 0.5)
"""Directions of who is holonomic and does not turn, the first to what is made for, and shares of its speed."""
SIDES = np.radians([45.0, 90.0, 135.0, -45.0, -90.0, -135.0])
"""[rad] directions in which others go that turn, but can go sideways too."""
COARSE, FREE, BESIDE = 2, 0.85, 3.0
"""Cells of a scan that are one of what is left to go; shares of its smallest disc that a base keeps there; and [m] that
are added where there is no way."""
SOON = 2
"""Steps before the end of a motion from which on a car is told the curve of the next one: its wheels take as long."""


class Weights(NamedTuple):
    """What motions cost, in metres of the way.

    Attributes:
        contact: [m/s] of overlapping a mover; twice as much from 0.2 m on.
        closer: [m/m] of coming closer to one, who is close, than if it stood.
        near: [m/s] of being close to one, less with the distance.
        tight: [m/s] of being close to things.
        turn: [m/rad]
        heading: [m/rad] its end looks past what is made for.
        late: [1/s] of what is left, while it is.
        back: [m] of a speed against that of the motion that was chosen last.
    """

    contact: float = 6.0
    closer: float = 0.0
    near: float = 0.72
    tight: float = 0.3
    turn: float = 0.02
    heading: float = 0.1
    late: float = 0.05
    back: float = 0.0


class Foresight(NamedTuple):
    """How far a search looks ahead: `depth` motions of `steps` ticks, twice as many from the one numbered `fine` on.

    It makes for a point of the way that is `aim` [s] ahead at full speed.
    """

    steps: int = 5
    fine: int = 6
    depth: int = 6
    aim: float = 1.6


class Margins(NamedTuple):
    """Distances [m].

    Attributes:
        movers: to them, below which it costs to be near.
        close: to movers, within which it costs to come closer.
        things: to them, below which it costs to be near.
        kept: to things at least, by which what is told and what is done may differ.
    """

    movers: float = 0.4
    close: float = 0.0
    things: float = 0.08
    kept: float = 0.02


class Search(NamedTuple):
    """What makes the search of a kind of base.

    Attributes:
        keeps: whether it goes on with what it chose last until it finds something better.
        lead: [s] by which what is told is ahead of what is: so much later the motions have that velocity.
    """

    weights: Weights = Weights()
    foresight: Foresight = Foresight()
    margins: Margins = Margins()
    keeps: bool = False
    lead: float = 0.35


USUAL: dict[BaseKind, Search] = {
    BaseKind.ACKERMANN: Search(
        Weights(contact=12.0, closer=60.0, near=3.0, tight=0.1, late=0.15, back=0.05),
        Foresight(fine=4, depth=8),
        Margins(close=0.2),
        keeps=True,
    ),
    BaseKind.HOLONOMIC: Search(
        Weights(closer=30.0, near=1.0, tight=0.1, heading=0.0, late=0.15),
        Foresight(aim=2.4),
        Margins(close=0.12, kept=0.0),
    ),
    BaseKind.QUADRUPED: Search(lead=STEP),
}
"""Of kinds that differ. A car needs longer to get out of a way, and gets nowhere when it shunts to and fro, as it does
when each time another of two plans is found; who can go aside is out of it at once, and swings round no corner. Neither
is to wait before what is narrow. Legs do at once what they are told, and stumble over what changes more than that."""


class Chosen(NamedTuple):
    """Velocities (3,), their cost [m], inf where all run into something, and the plan that they belong to."""

    twist: Array
    cost: float
    plan: Array


class BeamSearch:
    """Velocities of a base among movers, sideways where it can go so. It remembers nothing.

    The dynamic window holds one velocity for the time that it looks ahead. Who has to turn first, or to shunt, needs
    several in a row to let somebody pass: here motions of half a second follow one another, and of all that they lead
    to the most promising are gone on with (a beam search, after Lowerre 1976). Movers go on as they do now.

    Attributes:
        reach: [m] how far ahead the point of the way is that it makes for.
        no_plan: (1 + depth,) int64, the plan of who has none: steps of its first motion that are past, and motions.
    """

    def __init__(self, limits: BaseLimits, search: Search | None = None, *, width: int = 120) -> None:
        """`width` states are gone on with after each motion."""
        self.limits = limits
        weights, (*size, aim), margins, self._keeps, self._lead = search or USUAL.get(limits.kind, Search())
        self._weights, self._margins, self._size = np.array(weights, dtype=float), np.array(margins), (*size, width)
        self.no_plan = np.array([0] + [-1] * size[-1])
        self.reach = float(limits.high[0]) * aim
        self._curved = limits.turning_radius > 0.0
        self._aside = limits.kind is BaseKind.HOLONOMIC
        self._motions = _sideways(limits) if self._aside else _turning(limits)

    def choose(
        self,
        field: Array,
        cell: float,
        path: Array,
        aim: Array,
        now: Array,
        movers: Array,
        gear: float = 0.0,
        plan: Array | None = None,
    ) -> Chosen:
        """What is best now.

        The arguments are those of `DynamicWindow.choose`; `gear` is -1 where the way is to be gone backwards, `plan`
        what was chosen a step ago.
        """
        from anysim_navigation.kernels import beam

        limits, togo, motions = self.limits, np.zeros((0, 0)), self._motions
        now = np.array(now, dtype=float) * (limits.high > 0.0)
        if self._aside:  # a gap as wide as it is lies where it makes for, not where it looks
            c, s = np.array(aim) / max(float(np.hypot(*aim)), 1e-9)
            motions = motions @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
            motions = np.clip(motions, limits.low, limits.high)
        if self._curved:  # it goes further round than straight to a point ahead
            togo = left_to_go(field, cell, path, FREE * float(limits.discs[:, 2].min()))
        past, *meant = self.no_plan if plan is None else plan
        last = float(self._motions[meant[0], 0]) if meant[0] >= 0 else 0.0
        if not self._keeps:
            past, *meant = self.no_plan
        elif past == self._size[0]:  # its first motion is over
            past, meant = 0, [*meant[1:], -1]
        chosen, cost = beam.search(
            field,
            float(cell),
            limits.discs,
            np.ascontiguousarray(movers),
            np.array(aim, dtype=float),
            togo,
            COARSE * cell,
            now,
            last,
            motions,
            self._curved,
            limits.acceleration,
            float(gear),
            np.array(meant),
            int(past),
            self._weights,
            self._margins,
            STEP,
            *self._size,
        )
        told, left = now, self._lead
        for k, lasts in zip(chosen, ((self._size[0] - past) * STEP, self._lead), strict=False):
            most = limits.acceleration * min(lasts, left)
            told, left = told + np.clip((motions[k] if k >= 0 else 0.0) - told, -most, most), left - min(lasts, left)
        if self._curved:
            soon = chosen[1] if past >= self._size[0] - SOON else chosen[0]
            told[2] = told[0] * (motions[soon, 2] if soon >= 0 else 0.0)
        following = np.array([past + 1, *chosen]) if chosen[0] >= 0 else self.no_plan
        return Chosen(told, cost, following)


def _turning(limits: BaseLimits) -> Array:
    """(K, 3) speeds [m/s] with turns [rad/s], or of what cannot turn on the spot curvatures; and those to its sides."""
    curved = limits.turning_radius > 0.0
    most = 1.0 / limits.turning_radius if curved else float(limits.high[2])
    speeds = [share * float(limits.high[0] if share >= 0 else -limits.low[0]) for share in SPEEDS]
    turning = [(v, 0.0, most * turn) for v in speeds for turn in (TURNS if v or not curved else (0.0,))]
    sides = SIDES if limits.high[1] > 0.0 else SIDES[:0]
    aside = np.stack([np.cos(sides), np.sin(sides), 0.0 * sides], axis=1) * limits.high
    return np.concatenate([turning, aside.clip(limits.low, limits.high)])


def _sideways(limits: BaseLimits) -> Array:
    """(K, 3) velocities [m/s] in all directions, the first along x, and none that turns."""
    ways = 2 * np.pi * np.arange(WAYS) / WAYS
    each = np.stack([np.cos(ways), np.sin(ways), np.zeros(WAYS)], axis=1) * float(limits.high[0])
    return np.concatenate([np.zeros((1, 3)), *(share * each for share in PACES)])


def left_to_go(field: Array, cell: float, path: Array, room: float) -> Array:
    """[m] from each cell of a coarser field to the end of a way (K, 2), or to where the way leaves the field.

    Around what the field (rows, columns) has nearer than `room` [m]. From where there is no way it is a straight line.
    """
    from anysim_navigation.kernels import hybrid

    size, half = COARSE * cell, 0.5 * cell * np.array(field.shape[::-1])
    arcs = arcs_of(path)
    points = points_at(path, arcs, np.arange(0.0, arcs[-1] + cell, cell))
    beyond = np.flatnonzero((np.abs(points) > half - size).any(axis=1))
    end = points[max(beyond[0] - 1, 0) if len(beyond) else -1]
    free = field.reshape(field.shape[0] // COARSE, COARSE, -1, COARSE).mean(axis=(1, 3)) > room
    j, i = ((end + half) / size).astype(int)
    middle = np.array(free.shape) // 2
    for row, column, wide in ((i, j, 1), (*middle, 2)):  # where it is and where it goes it can be
        free[max(row - wide, 0) : row + wide + 1, max(column - wide, 0) : column + wide + 1] = True
    togo = hybrid.distances_to(free, int(i), int(j)) * size
    rows, columns = np.indices(togo.shape)
    straight = np.hypot((columns + 0.5) * size - half[0] - end[0], (rows + 0.5) * size - half[1] - end[1])
    return np.where(np.isfinite(togo), togo, straight + BESIDE)

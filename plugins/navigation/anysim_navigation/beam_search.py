"""The beam search: where people walk, the best of what a base can do in the next seconds, with waits and detours."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim_navigation.dynamic_window import STEP
from anysim_navigation.limits import BaseKind, BaseLimits

SPEEDS = (1.0, 0.5, 0.0, -1.0)
"""Of the fastest forwards and backwards."""
TURNS = (-1.0, -0.4, 0.0, 0.4, 1.0)
"""Of the fastest turn, or of the tightest curve."""
WINDOW = 0.35
"""[s] of acceleration by which what is told may differ from what is."""


class Weights(NamedTuple):
    """What motions cost, in metres of the way.

    Attributes:
        contact: [m/s] of overlapping a mover; twice as much from 0.2 m on.
        near: [m/s] of being close to one, less with the distance.
        tight: [m/s] of being close to things.
        turn: [m/rad]
        heading: [m/rad] its end looks past what is made for.
        late: [1/s] of what is left, while it is.
    """

    contact: float = 6.0
    near: float = 0.72
    tight: float = 0.3
    turn: float = 0.02
    heading: float = 0.1
    late: float = 0.05


NEAR: dict[BaseKind, float] = {BaseKind.ACKERMANN: 1.5}
"""What nearness costs where it is not the usual weight: a car needs longer to get out of a way."""


class BeamSearch:
    """Velocities of a base that cannot go sideways, among movers. It remembers nothing.

    The dynamic window holds one velocity for the time that it looks ahead. Who has to turn first, or to shunt, needs
    several in a row to let somebody pass: here motions of half a second follow one another, and of all that they lead
    to the most promising are gone on with (a beam search, after Lowerre 1976). Movers go on as they do now.
    """

    def __init__(
        self,
        limits: BaseLimits,
        weights: Weights | None = None,
        *,
        steps: int = 5,
        depth: int = 6,
        width: int = 120,
        margins: tuple[float, float] = (0.4, 0.08),
    ) -> None:
        """`depth` motions of `steps` ticks are looked ahead, `width` states are gone on with after each."""
        self.limits = limits
        if weights is None:
            weights = Weights(near=NEAR.get(limits.kind, Weights().near))
        self._weights, self._margins = np.array(weights, dtype=float), np.array(margins)
        self._size = steps, depth, width
        self._curved = limits.turning_radius > 0.0
        most = 1.0 / limits.turning_radius if self._curved else float(limits.high[2])
        speeds = [share * float(limits.high[0] if share >= 0 else -limits.low[0]) for share in SPEEDS]
        self._motions = np.array(
            [(v, most * turn) for v in speeds for turn in (TURNS if v or not self._curved else (0.0,))]
        )

    def choose(
        self, field: Array, cell: float, aim: Array, now: Array, movers: Array, gear: float = 0.0
    ) -> tuple[Array, float]:
        """Velocities (3,), and their cost [m], inf where all run into something.

        The arguments are those of `DynamicWindow.choose`; `gear` is -1 where the way is to be gone backwards.
        """
        from anysim_navigation.kernels import beam

        limits, (steps, depth, width) = self.limits, self._size
        first, cost = beam.search(
            field,
            float(cell),
            limits.discs,
            np.ascontiguousarray(movers),
            np.array(aim, dtype=float),
            np.array(now, dtype=float),
            self._motions,
            self._curved,
            limits.acceleration,
            float(gear),
            self._weights,
            self._margins,
            STEP,
            steps,
            depth,
            width,
        )
        speed, turn = self._motions[first] if first >= 0 else (0.0, 0.0)
        most = limits.acceleration * WINDOW
        told = now + np.clip(np.array([speed, 0.0, turn]) - now, -most, most)
        told[1] = 0.0
        if self._curved:
            told[2] = turn * told[0]
        return told, cost

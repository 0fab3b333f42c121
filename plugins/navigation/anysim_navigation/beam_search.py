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
DIRECTIONS = 12
"""In which a base goes that need not turn, with the positive of these speeds."""
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


USUAL: dict[BaseKind, Weights] = {BaseKind.ACKERMANN: Weights(near=1.5), BaseKind.HOLONOMIC: Weights(heading=0.0)}
"""Of kinds that differ: a car needs longer to get out of a way; who goes sideways need not look ahead."""


class BeamSearch:
    """Velocities of a base on wheels among movers. It remembers nothing.

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
            weights = USUAL.get(limits.kind, Weights())
        self._weights, self._margins = np.array(weights, dtype=float), np.array(margins)
        self._size = steps, depth, width
        self._curved = limits.turning_radius > 0.0
        self._motions = _motions(limits)

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
        motion = self._motions[first] if first >= 0 else np.zeros(3)
        most = limits.acceleration * WINDOW
        told = np.clip(now + np.clip(motion - now, -most, most), limits.low, limits.high)
        if self._curved:
            told[2] = motion[2] * told[0]
        return told, cost


def _motions(limits: BaseLimits) -> Array:
    """(K, 3) forward and aside [m/s] with a turn [rad/s], of a car with a curvature [1/m]."""
    if limits.kind is BaseKind.HOLONOMIC:
        turn = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        ways = np.stack([np.cos(turn), np.sin(turn), np.zeros(DIRECTIONS)], axis=1)
        ways *= np.where(ways > 0, limits.high, -limits.low)
        return np.concatenate([*(share * ways for share in SPEEDS if share > 0), np.zeros((1, 3))])
    curved = limits.turning_radius > 0.0
    most = 1.0 / limits.turning_radius if curved else float(limits.high[2])
    speeds = [share * float(limits.high[0] if share >= 0 else -limits.low[0]) for share in SPEEDS]
    return np.array([(v, 0.0, most * turn) for v in speeds for turn in (TURNS if v or not curved else (0.0,))])

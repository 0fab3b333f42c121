"""Bounds of physics: values beyond them are refused, since engines answer them with nonsense, and in silence.

Each was measured on MuJoCo, PyBullet and SAPIEN, with boxes and balls that should rest on the ground.
"""

from collections.abc import Sequence
from typing import NamedTuple


class Bound(NamedTuple):
    """The smallest and the largest value that is accepted.

    Attributes:
        low, high: the bounds, both included.
        unit: of both.
        thing: what is bounded, and the keys that say it.
        reason: what happens beyond.
    """

    low: float
    high: float
    unit: str
    thing: str
    reason: str

    def holds(self, value: float) -> bool:
        """Whether a value is within the bounds."""
        return self.low <= value <= self.high

    def sentence(self, value: float) -> str:
        """`is 1e-09 m; from 0.0001 to 10,000 m is possible: …` for a value beyond them."""
        span = f"from {_number(self.low)} to {_number(self.high)} {self.unit}"
        return f"is {value:.3g} {self.unit}; {span} is possible: {self.reason}"


LENGTH = Bound(
    1e-4,
    1e4,
    "m",
    "sizes of shapes: edges, radii, heights",
    "things of 0.01 mm sink through the ground, and things of 100 km are not finite in single precision",
)
SCALE = Bound(1e-6, 1e6, "", "`scale` of an object or a source", "sizes have bounds, whatever their units")
MASS = Bound(
    1e-9,
    1e9,
    "kg",
    "mass of what moves",
    "contacts are not stiff enough for more: from 1e15 kg on everything falls through the ground",
)
DENSITY = Bound(1e-3, 1e6, "kg/m^3", "`density` of an object", "air has 1.2, osmium 22,600")
MOMENT = Bound(
    1e-15, 1e18, "kg m^2", "smallest moment of inertia of what moves", "MuJoCo takes no less: a cube of water of 0.4 mm"
)
TIME_STEP = Bound(
    1e-6,
    0.05,
    "s",
    "`physics.dt`",
    "at 0.1 s boxes of 5 cm fall through the ground, and half of it is the longest step at which they rest on it",
)
EXTENT = Bound(1.0, 1e6, "m", "`physics.extent`", "positions in single precision are exact to 6 cm there")
DEFAULT_EXTENT = 1e4
"""Distance from the origin along an axis [m] beyond which a body has left the world; single precision: 1 mm."""

_ALL: Sequence[Bound] = (LENGTH, SCALE, MASS, DENSITY, MOMENT, TIME_STEP, EXTENT)


def table() -> str:
    """All bounds as a table in Markdown."""
    rows = ["| quantity | from | to | why |", "|---|---|---|---|"]
    for bound in _ALL:
        low, high = (f"{_number(value)} {bound.unit}".strip() for value in (bound.low, bound.high))
        rows.append(f"| {bound.thing} | {low} | {high} | {bound.reason} |")
    return "\n".join(rows) + "\n"


def _number(value: float) -> str:
    return f"{value:,.10g}" if 1e-4 <= value < 1e7 else f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")

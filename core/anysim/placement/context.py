"""What a place is found with: where its numbers come from, and what is there already."""

from collections.abc import Sequence
from math import pi
from typing import Any, NamedTuple, Protocol

from anysim.geometry import polygon as G
from anysim.geometry.convex_parts import Placed, Vec
from anysim.placement.support_surfaces import SupportSurface
from anysim_schemas.regions import RegionSpec

SIDE_ANGLE = {"in_front_of": 0.0, "left_of": 0.5 * pi, "behind": pi, "right_of": -0.5 * pi}
"""The direction of each side against the x axis [rad]."""


class Dice(Protocol):
    """Where the numbers come from."""

    def value(self, field: str, value: Any) -> Any:
        """A field of the entry, drawn."""
        ...

    def uniform(self, purpose: str, count: int) -> Sequence[float]:
        """Numbers in [0, 1) for one purpose."""
        ...


class Around(Protocol):
    """What is there already, for who is being placed."""

    origin: Vec

    def find(self, name: str) -> Placed | None:
        """An object or a robot by name; None where it is not there."""
        ...

    def surfaces_of(self, placed: Placed) -> Sequence[SupportSurface]:
        """The surfaces of a placed thing, in the frame of its root as it is turned, but for its heading."""
        ...

    def ground(self, low: G.Point, high: G.Point) -> float:
        """The greatest height of the ground under a rectangle."""
        ...

    def support_of(self, name: str) -> tuple[str, bool] | None:
        """What a placed thing rests on, and whether inside of it; None where its position was given."""
        ...

    def region(self, name: str) -> RegionSpec:
        """A region by name."""
        ...


class Impossible(NamedTuple):
    """Why there is no candidate. `hopeless` where no draw would help."""

    reason: str
    hopeless: bool = False

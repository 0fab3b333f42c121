"""Limits and shapes of bases, in which the variants of local planning differ."""

from enum import StrEnum
from math import inf
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError, listing


class BaseKind(StrEnum):
    """How a base moves, and what its channel takes."""

    HOLONOMIC = "holonomic"
    DIFFERENTIAL = "differential"
    ACKERMANN = "ackermann"
    HUMANOID = "humanoid"
    QUADRUPED = "quadruped"


OUTPUTS: dict[BaseKind, tuple[tuple[str, ...], ...]] = {
    BaseKind.HOLONOMIC: (("forward", "left", "turn"),),
    BaseKind.DIFFERENTIAL: (("speed", "turn"),),
    BaseKind.ACKERMANN: (("speed", "turn"), ("speed", "steering")),
    BaseKind.HUMANOID: (("forward", "left", "turn"),),
    BaseKind.QUADRUPED: (("forward", "left", "turn"),),
}
"""The components of the actions of the channels that each kind drives."""
SAMPLES: dict[BaseKind, tuple[int, int, int]] = {
    BaseKind.HOLONOMIC: (7, 7, 5),
    BaseKind.DIFFERENTIAL: (9, 1, 21),
    BaseKind.ACKERMANN: (9, 1, 21),
    BaseKind.HUMANOID: (7, 3, 9),
    BaseKind.QUADRUPED: (7, 5, 9),
}
"""Velocities forward, to the left and turning that are tried of each kind."""


SWAY = {BaseKind.HUMANOID: 0.075}
"""[m] to both sides of who walks, 0.073 m of the G1 at all its velocities; that of a moment says nothing of its way."""
ACCELERATIONS = {BaseKind.HUMANOID: (0.25, 0.4), BaseKind.QUADRUPED: (0.6, 1.5)}
"""[m/s^2], [rad/s^2] of legs, which follow with their next step: who is to turn about within a stride may fall."""


class BaseLimits(NamedTuple):
    """What a base can do, and the room that it takes.

    Attributes:
        kind: how it moves.
        low, high: (3,) velocities forward and to the left [m/s] and turning left [rad/s].
        acceleration: (3,) [m/s^2], [m/s^2], [rad/s^2], to brake as well.
        discs: (D, 3) x, y and radius [m] in the frame of the base; together they cover it.
        turning_radius: [m] the tightest circle; 0 for what turns on the spot.
    """

    kind: BaseKind
    low: Array
    high: Array
    acceleration: Array
    discs: Array
    turning_radius: float = 0.0
    delay: float = 0.0

    @property
    def radius(self) -> float:
        """[m] that it takes to either side of its way, by which ways keep clear of things."""
        return float((np.abs(self.discs[:, 1]) + self.discs[:, 2]).max())

    def check(self) -> None:
        """Look for what no planning is possible with.

        Raises:
            AnysimError: limits that leave no motion, or discs that are none.
        """
        if self.discs.ndim != 2 or self.discs.shape[1] != 3 or not len(self.discs) or (self.discs[:, 2] <= 0).any():
            raise AnysimError(f"the discs of a {self.kind} base: expected rows x, y and a radius above 0")
        meant = (self.low <= 0).all() and (self.high >= 0).all() and (self.acceleration > 0).all()
        if not (meant and self.high[0] > 0):
            raise AnysimError(
                f"limits of a {self.kind} base from {self.low.tolist()} to {self.high.tolist()}: expected 0 within all "
                "of them, a speed forward above 0, and accelerations above 0"
            )


def limits_of(
    kind: BaseKind,
    discs: Array,
    *,
    speed: float,
    turn: float,
    side: float | None = None,
    back: float | None = None,
    acceleration: tuple[float, float] | None = None,
    turning_radius: float = 0.0,
    delay: float = 0.0,
) -> BaseLimits:
    """Limits with what is usual for a kind where nothing is given.

    Args:
        kind: how it moves.
        discs: (D, 3) x, y, radius [m].
        speed, turn: forward [m/s], and turning [rad/s].
        side: [m/s] to both sides; as forward for what is holonomic, a third of it on legs, else none.
        back: [m/s] backwards; as forward for what is holonomic, else half of it.
        acceleration: [m/s^2], [rad/s^2]; (1, 3), on legs `ACCELERATIONS`.
        turning_radius: [m] of a car.
        delay: [s] after which it does what it is told.
    """
    if kind in (BaseKind.DIFFERENTIAL, BaseKind.ACKERMANN):
        side = 0.0
    elif side is None:
        side = speed if kind is BaseKind.HOLONOMIC else speed / 3
    if back is None:
        back = speed if kind is BaseKind.HOLONOMIC else speed / 2
    if kind is BaseKind.ACKERMANN and turning_radius <= 0:
        raise AnysimError("a car has a turning_radius above 0 [m]: wheelbase / tan(most steering)")
    low, high = np.array([-back, -side, -turn]), np.array([speed, side, turn])
    faster, sooner = acceleration or ACCELERATIONS.get(kind, (1.0, 3.0))
    made = BaseLimits(kind, low, high, np.array([faster, faster, sooner]), discs, turning_radius, delay)
    made.check()
    return made


def kind_of(labels: tuple[str, ...], legs: int = 0) -> BaseKind:
    """The kind of a base with a channel of these components, and with so many legs.

    Raises:
        AnysimError: no kind has such a channel.
    """
    if legs:
        return BaseKind.HUMANOID if legs == 2 else BaseKind.QUADRUPED
    for kind, outputs in OUTPUTS.items():
        if labels in outputs:
            return BaseKind.ACKERMANN if "steering" in labels else kind
    known = listing([f"({', '.join(names)})" for outputs in OUTPUTS.values() for names in outputs])
    raise AnysimError(f"a channel of ({', '.join(labels)}) drives no base that can be planned for; known are {known}")


def output_of(limits: BaseLimits, labels: tuple[str, ...], twist: Array, wheelbase: float = inf) -> Array:
    """The action (n, A) of a channel with these components for velocities (n, 3)."""
    if labels == ("forward", "left", "turn"):
        return twist
    if labels == ("speed", "turn"):
        return twist[:, [0, 2]]
    moves = np.abs(twist[:, 0]) > 1e-3
    curvature = np.where(moves, twist[:, 2] / np.where(moves, twist[:, 0], 1.0), 0.0)
    most = 1.0 / limits.turning_radius
    return np.stack([twist[:, 0], np.arctan(wheelbase * np.clip(curvature, -most, most))], axis=1)


def discs_over(outline: Array, least: int = 1) -> Array:
    """(D, 3) discs in a row, `least` or more, over the hull of points (K, 2) [m], along its longer side."""
    import shapely

    low, high = outline.min(axis=0), outline.max(axis=0)
    size = high - low
    long = int(size[1] > size[0])
    count = max(least, int(np.ceil(size[long] / size[1 - long] - 0.2)))
    discs = np.empty((count, 3))
    hull: Any = shapely.MultiPoint(outline).convex_hull
    for k in range(count):
        low[long], high[long] = (outline[:, long].min() + size[long] * (k + e) / count for e in (0, 1))
        discs[k, :2] = 0.5 * (low + high)
        part: Any = hull.intersection(shapely.box(*low, *high))
        discs[k, 2] = np.hypot(*(np.array(part.exterior.coords) - discs[k, :2]).T).max()
    return discs

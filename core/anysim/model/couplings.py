"""Couplings of what moves: tendons of joints and through space, and frames of two bodies that are held together."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import StrEnum
from math import inf
from typing import NamedTuple

from anysim.conventions import IDENTITY_QUATERNION, WORLD
from anysim.model.parts import ORIGIN, Quat
from anysim.model.shapes import HASHED_IF_GIVEN, Compliance, Vec3


@dataclass(frozen=True, slots=True)
class Tendon:
    """A fixed tendon: its length is the sum of `coefficients` times the positions of `joints`, of one articulation.

    A force along the length acts on each joint times its coefficient, beside the drives and their limits. A spring
    pulls with `stiffness` times the way to the interval `rest`, by the length at the beginning of the physics step;
    `damping` acts on the rate of the length at its end. `lower` and `upper` bound the length, which is held where they
    are equal; `friction` is dry friction and `armature` an inertia along it. Units are those of the sum, [rad] or [m].
    """

    name: str
    joints: tuple[int, ...]
    coefficients: tuple[float, ...]
    stiffness: float = 0.0
    damping: float = 0.0
    rest: tuple[float, float] = (0.0, 0.0)
    lower: float = -inf
    upper: float = inf
    friction: float = 0.0
    armature: float = 0.0
    limit_softness: float = 0.0  # time constant [s] of the limit; 0 leaves it to the engine
    limit_compliance: Compliance | None = field(default=None, metadata=HASHED_IF_GIVEN)
    friction_compliance: Compliance | None = field(default=None, metadata=HASHED_IF_GIVEN)

    def renumbered(self, joint: Callable[[int], int], prefix: str = "") -> "Tendon":
        """The same tendon where joints have other numbers and names begin with `prefix`."""
        return replace(self, name=f"{prefix}{self.name}", joints=tuple(joint(j) for j in self.joints))


class Wrap(NamedTuple):
    """A ball, or an endless cylinder along its z, that a tendon lies around, on the side of a point if there is one.

    `position`, `quaternion` are in the frame of the body, `side` [m] in that of `side_body`.
    """

    radius: float
    cylinder: bool
    quaternion: Quat = IDENTITY_QUATERNION
    side: Vec3 | None = None
    side_body: int = WORLD


class Waypoint(NamedTuple):
    """A point [m] in the frame of a body (-1: the world) that a tendon runs through, or the middle of what it wraps.

    With a `pulley` it is no point: what comes after it is another branch, and counts by its length over that number.
    """

    body: int = WORLD
    position: Vec3 = ORIGIN
    wrap: Wrap | None = None
    pulley: float = 0.0


@dataclass(frozen=True, slots=True)
class SpatialTendon:
    """A string through space: its length [m] is that of the shortest way along `path`. The rest is as of `Tendon`."""

    name: str
    path: tuple[Waypoint, ...]
    stiffness: float = 0.0
    damping: float = 0.0
    rest: tuple[float, float] = (0.0, 0.0)
    lower: float = -inf
    upper: float = inf
    friction: float = 0.0
    armature: float = 0.0
    limit_softness: float = 0.0
    limit_compliance: Compliance | None = None
    friction_compliance: Compliance | None = None

    @property
    def bodies(self) -> tuple[int, ...]:
        """The bodies it runs along, -1 for the world."""
        sides = [p.wrap.side_body for p in self.path if p.wrap is not None and p.wrap.side is not None]
        return tuple(dict.fromkeys([*(p.body for p in self.path if not p.pulley), *sides]))

    def renumbered(self, body: Callable[[int], int], prefix: str = "") -> "SpatialTendon":
        """The same tendon where bodies have other numbers and names begin with `prefix`."""
        new = lambda b: b if b == WORLD else body(b)  # noqa: E731
        path = (
            p._replace(body=new(p.body), wrap=p.wrap and p.wrap._replace(side_body=new(p.wrap.side_body)))
            for p in self.path
        )
        return replace(self, name=f"{prefix}{self.name}", path=tuple(path))


class ConstraintKind(StrEnum):
    """What holds two frames together."""

    CONNECT = "connect"  # their origins meet, and they turn as they like
    WELD = "weld"  # they are one


@dataclass(frozen=True, slots=True)
class Constraint:
    """A frame of a body and a frame of another (or of the world: -1) that are held together: a closed loop, a weld.

    `position` [m], `quaternion` are in the frame of `body`, `other_position`, `other_quaternion` in that of `other`.
    """

    name: str
    kind: ConstraintKind
    body: int
    other: int = WORLD
    position: Vec3 = ORIGIN
    quaternion: Quat = IDENTITY_QUATERNION
    other_position: Vec3 = ORIGIN
    other_quaternion: Quat = IDENTITY_QUATERNION
    softness: float = 0.0  # time constant [s]; 0 leaves it to the engine
    compliance: Compliance | None = field(default=None, metadata=HASHED_IF_GIVEN)
    turn_scale: float = field(default=1.0, metadata=HASHED_IF_GIVEN)
    """[m] How a weld weighs turns against shifts."""

    def renumbered(self, body: Callable[[int], int], prefix: str = "") -> "Constraint":
        """The same constraint where bodies have other numbers and names begin with `prefix`."""
        other = self.other if self.other == WORLD else body(self.other)
        return replace(self, name=f"{prefix}{self.name}", body=body(self.body), other=other)

"""Couplings of what moves: fixed tendons between joints, and frames of two bodies that are held together."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from math import inf

from anysim.conventions import IDENTITY_QUATERNION, WORLD
from anysim.model.parts import ORIGIN, Quat
from anysim.model.shapes import Vec3


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

    def renumbered(self, joint: Callable[[int], int], prefix: str = "") -> "Tendon":
        """The same tendon where joints have other numbers and names begin with `prefix`."""
        return replace(self, name=f"{prefix}{self.name}", joints=tuple(joint(j) for j in self.joints))


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

    def renumbered(self, body: Callable[[int], int], prefix: str = "") -> "Constraint":
        """The same constraint where bodies have other numbers and names begin with `prefix`."""
        other = self.other if self.other == WORLD else body(self.other)
        return replace(self, name=f"{prefix}{self.name}", body=body(self.body), other=other)

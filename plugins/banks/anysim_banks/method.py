"""Methods: how candidates of one thing are sampled, filtered and tried; a bank is made in the same steps by each."""

from collections.abc import Mapping
from typing import NamedTuple, Protocol, Self

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.affordances import Affordance
from anysim_banks.collision import CollisionFilter
from anysim_banks.gripper import Gripper
from anysim_banks.sampling import Candidates, sample
from anysim_banks.subject import Subject
from anysim_banks.trial import CREEP, HARDEST, LONG, SHIFT, TURN, Trial, Verdicts

_DIGITS = 9


class Tried(Protocol):
    """Trials on one engine, in `with`."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def run(self, candidates: Candidates, *, hard: bool = True) -> Verdicts:
        """The easy test, which admits, and the hard one, which ranks."""
        ...

    def lasting(self, candidates: Candidates, limits: tuple[float, float] = (SHIFT, TURN)) -> Array:
        """(n,) bool: what is held longer, with the thing moving less than `limits` [m], [rad]."""
        ...


class About(Protocol):
    """What candidates are of."""

    @property
    def asset(self) -> str: ...
    @property
    def affordance(self) -> Affordance: ...
    @property
    def hash(self) -> str: ...
    @property
    def place(self) -> str: ...
    @property
    def link(self) -> int: ...


class Tool(Protocol):
    """What is brought there: a gripper, a hand, or what is put into a hole."""

    @property
    def name(self) -> str: ...
    @property
    def hash(self) -> str: ...


class Method(Protocol):
    """How the candidates of a bank are found."""

    @property
    def subject(self) -> About: ...
    @property
    def tool(self) -> Tool: ...

    def sampled(self, count: int, rng: np.random.Generator) -> Candidates:
        """At most `count` candidates."""
        ...

    def free(self, candidates: Candidates) -> Array:
        """(n,) bool: those in which nothing touches what it should not."""
        ...

    def trial(self, engine: str) -> Tried:
        """Trials on an engine."""
        ...

    def about(self) -> Mapping[str, object]:
        """For the bank's provenance."""
        ...

    def failed(self, raw: int, free: int, held: int) -> str:
        """A sentence on why no bank was made, of how many were sampled, free and held."""
        ...


class Grasps(NamedTuple):
    """Grasps of a subject with a parallel gripper."""

    subject: Subject
    tool: Gripper

    def sampled(self, count: int, rng: np.random.Generator) -> Candidates:
        one = self.subject
        found = sample(one.pieces, one.affordance, one.frame, count, self.tool.max_width, rng)
        return within_region(found, one)

    def free(self, candidates: Candidates) -> Array:
        return CollisionFilter(self.tool, self.subject.around).free(candidates.pose, candidates.width)

    def trial(self, engine: str) -> Tried:
        return Trial(self.tool, self.subject, engine)

    def about(self) -> Mapping[str, object]:
        test = {"hardest": HARDEST, "shift": SHIFT, "turn": TURN, "long": LONG, "creep": list(CREEP)}
        return {"stroke": round(self.tool.stroke, _DIGITS), "test": test}

    def failed(self, raw: int, free: int, held: int) -> str:
        wide = f"nothing there is narrower than {self.tool.max_width:g} m" if raw == 0 else f"{raw} grasps were sampled"
        return (
            f"no grasp of {self.subject.asset} {self.subject.affordance.name} was held: {wide}, {free} free of "
            f"collision, {held} held, none of those for half a second; another gripper, or an affordance with other "
            "pieces or approaches, may do"
        )


def within_region(found: Candidates, subject: Subject) -> Candidates:
    """Those in the ball that a subject keeps to, if it keeps to one."""
    if subject.region is None:
        return found
    point, radius = subject.region
    there = P.rotate(subject.frame[3:], np.array(point)) + subject.frame[:3]
    return found.take(np.flatnonzero(P.norm(found.pose[:, :3] - there) <= radius))

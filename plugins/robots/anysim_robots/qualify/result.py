"""Results of a qualification, as plain data."""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

Status = Literal["qualified", "failed", "absent", "refused"]
"""All that was asked passed; a check did not; the robot's files are not installed; the engine says that it cannot."""


class Check(NamedTuple):
    """One question to the robot on the engine.

    Attributes:
        name: one of `CHECKS`.
        passed: the answer; None where it was not asked, and `words` say why.
        figure: what was measured.
        unit: of the figure and the limit.
        limit: the largest figure that passes.
        words: the cause where it failed; else what else there is to know.
    """

    name: str
    passed: bool | None
    figure: float | None = None
    unit: str = ""
    limit: float | None = None
    words: str = ""

    @property
    def told(self) -> str:
        """One line for people."""
        word = {True: "passed", False: "FAILED", None: "not asked"}[self.passed]
        figure = "" if self.figure is None else f" {self.figure:.3g}{f' {self.unit}' if self.unit else ''}"
        limit = "" if self.limit is None or self.figure is None else f" (at most {self.limit:g})"
        return f"{self.name}: {word}{figure}{limit}{f'; {self.words}' if self.words else ''}"


CHECKS: Mapping[str, str] = {
    "build": "the catalogue entry becomes a world, and the engine builds it",
    "source": "number of joints and mass are those of the source, read by somebody else",
    "audit": "masses, limits, volumes, axes and frames read back from the engine are those of the world",
    "kinematics": "link frames at random joint positions are where another loader of the source has them",
    "hold": "its default controllers hold the home position against gravity; what floats stands on the ground",
    "random": "random actions within the bounds of its default controllers cause no fault",
    "replay": "the same actions again give the same state, bit for bit",
}
"""The checks, in order, and what each asks."""


class Facts(NamedTuple):
    """What a robot is, as the World has it.

    `mass` [kg] is that of all its links; `joints` are degrees of freedom, `followers` those of them that follow
    another, `drives` those that are commanded.
    """

    mass: float
    joints: int
    followers: int
    drives: int
    links: int


class Qualification(NamedTuple):
    """A robot on an engine. `oracle` says whom its kinematics were compared with, `why` what was not done."""

    robot: str
    engine: str
    engine_version: str
    status: Status
    checks: tuple[Check, ...]
    why: str = ""
    oracle: str = ""
    facts: Facts | None = None
    seconds: float = 0.0
    """Wall-clock time that it took; never part of a verdict."""

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that did not pass."""
        return tuple(check for check in self.checks if check.passed is False)


def as_data(found: Qualification) -> dict[str, Any]:
    """Plain data for JSON."""
    data = found._asdict()
    data["facts"] = None if found.facts is None else found.facts._asdict()
    data["checks"] = [check._asdict() for check in found.checks]
    return data


def from_data(data: Mapping[str, Any]) -> Qualification:
    """What `as_data` wrote."""
    facts = data.get("facts")
    checks = tuple(Check(**check) for check in data["checks"])
    rest = {key: value for key, value in data.items() if key not in ("facts", "checks")}
    return Qualification(checks=checks, facts=None if facts is None else Facts(**facts), **rest)

"""Pairs of tasks: the quantities that decide their success, and where the two rules differ on purpose."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim_maniskill.verdicts.sketch import Sketch

Verdict = Callable[[Sketch], Array]
"""What a peer says of the states of a sketch: (N,) bool."""


class Quantity(NamedTuple):
    """A number of a state that the success depends on, such as a distance [m] or a speed [m/s].

    Attributes:
        well: a range in which it obstructs nothing.
        around: a range about the threshold, or about both where the two rules have thresholds of their own.
    """

    well: tuple[float, float]
    around: tuple[float, float]


@dataclass(frozen=True)
class Difference:
    """A point on which the two rules differ on purpose.

    Attributes:
        reason: one sentence.
        overrides: what makes our rule the peer's in this point: another constant, or a term less.
        asked: what the peer asks for beside that and our rule cannot say, (N,) bool of a sketch.
    """

    reason: str
    overrides: tuple[str, ...]
    asked: Verdict | None = None


@dataclass(frozen=True)
class Pair:
    """A task of ours and one of a peer.

    Attributes:
        peer: its name there, as `maniskill:PickCube-v1`.
        task: ours.
        quantities: by name. Each is a boundary.
        write: puts states with these quantities (N,) into a sketch; directions are drawn.
        verdict: loads the peer and judges.
        differences: by name.
        overrides: of our task, where only a part of it has a counterpart.
    """

    peer: str
    task: str
    quantities: Mapping[str, Quantity]
    write: Callable[[Sketch, Mapping[str, Array], np.random.Generator], None]
    verdict: Verdict
    differences: Mapping[str, Difference] = field(default_factory=dict)
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class Agreement:
    """How two rules judged the same states around one boundary.

    Attributes:
        peer: the peer's task.
        task: ours.
        boundary: the quantity whose threshold the states lie around.
        states: how many.
        ours: how many are a success for our rule.
        theirs: how many are one for the peer's.
        differ: in how many the verdicts differ.
        by: how many of these each difference settles by itself, by its name; others need several at once.
        unexplained: in how many the verdicts still differ when our rule has all listed differences taken out.
    """

    peer: str
    task: str
    boundary: str
    states: int
    ours: int
    theirs: int
    differ: int
    by: Mapping[str, int]
    unexplained: int


def agreements(pair: Pair, states: int, seed: int) -> list[Agreement]:
    """Both verdicts on `states` states around each boundary of a pair.

    The same states are judged by our rule as it is, with each difference taken out, and with all of them.

    Raises:
        PluginError: the peer is not installed; the message says how to.
    """
    every = [line for difference in pair.differences.values() for line in difference.overrides]
    variants = {
        "": (pair.overrides, []),
        **{name: ((*pair.overrides, *d.overrides), [d]) for name, d in pair.differences.items()},
        "*": ((*pair.overrides, *every), list(pair.differences.values())),
    }
    judged = {name: _judged(pair, overrides, asked, states, seed) for name, (overrides, asked) in variants.items()}
    theirs = _on_each(pair, pair.overrides, states, seed, pair.verdict)
    found: list[Agreement] = []
    for row, boundary in enumerate(pair.quantities):
        peer, ours, reduced = theirs[row], judged[""][row], judged["*"][row]
        differ = ours != peer
        by = {name: int((differ & (judged[name][row] == peer)).sum()) for name in pair.differences}
        yes, agreed, apart, left = (int(rows.sum()) for rows in (ours, peer, differ, reduced != peer))
        found.append(Agreement(pair.peer, pair.task, boundary, states, yes, agreed, apart, by, left))
    return found


def _judged(
    pair: Pair, overrides: Sequence[str], differences: Sequence[Difference], states: int, seed: int
) -> list[Array]:
    def verdict(sketch: Sketch) -> Array:
        said = sketch.judge()
        for difference in differences:
            said = said if difference.asked is None else said & difference.asked(sketch)
        return said

    return _on_each(pair, overrides, states, seed, verdict)


def _on_each(pair: Pair, overrides: Sequence[str], states: int, seed: int, verdict: Verdict) -> list[Array]:
    """A verdict (N,) on the states around each boundary: the same states whatever the overrides."""
    found: list[Array] = []
    with Sketch(pair.task, states, overrides) as sketch:
        for row, boundary in enumerate(pair.quantities):
            rng = np.random.default_rng([seed, row])
            drawn = {
                name: rng.uniform(*(q.around if name == boundary else q.well), size=states)
                for name, q in pair.quantities.items()
            }
            pair.write(sketch, drawn, rng)
            found.append(verdict(sketch))
    return found


def direction(rng: np.random.Generator, count: int, *, level: bool = False) -> Array:
    """Unit vectors (N, 3), evenly in all directions, or in the horizontal ones."""
    drawn = rng.normal(size=(count, 3))
    drawn[:, 2] *= not level
    return drawn / P.norm(drawn)[:, None]


def signs(rng: np.random.Generator, count: int) -> Array:
    """(N,) of 1.0 and -1.0."""
    return rng.choice([-1.0, 1.0], size=count)


def turned(rng: np.random.Generator, angle: Array, *, level: bool = False) -> Array:
    """Rotations (N, 4) by an angle (N,) [rad] about an axis in any direction, or in a horizontal one."""
    return P.from_axis_angle(direction(rng, len(angle), level=level), angle)


def yawed(rng: np.random.Generator, count: int) -> Array:
    """Rotations (N, 4) by any angle about the vertical."""
    return P.from_axis_angle(np.tile([0.0, 0.0, 1.0], (count, 1)), rng.uniform(-np.pi, np.pi, count))

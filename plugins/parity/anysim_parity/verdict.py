"""Verdict on a layer: which engines agree, which are near the analytic answer, and what is furthest off."""

import re
from collections.abc import Iterable, Iterator
from itertools import combinations
from typing import NamedTuple

from anysim_parity.judge import errors
from anysim_parity.result import Layer, Measure

ANALYTIC = "the analytic answer"


class Finding(NamedTuple):
    """One comparison that has a tolerance.

    `first` is an engine, `second` another or `ANALYTIC`; `gap` [unit] is how far apart they are, `tolerance` how far
    they may be.
    """

    layer: str
    subject: str
    unit: str
    first: str
    second: str
    gap: float
    tolerance: float
    agree: bool
    explanation: str

    @property
    def ratio(self) -> float:
        """The gap in units of the tolerance; 1 for shares of episodes that differ, which have none."""
        return self.gap / self.tolerance if self.tolerance > 0 else 1.0

    @property
    def declared(self) -> bool:
        """Whether one of the two engines declares what this goes back to; else a difference is news."""
        return declares(self.explanation, self.first, self.second)


def findings(layer: Layer) -> list[Finding]:
    """Every comparison of a layer: engines with the analytic answer, and with each other.

    Two engines may differ by twice the tolerance from an analytic answer, once in each direction. Where a layer has
    gaps, those say how engines differ from each other, and its measures how each differs from the answer.
    """
    found = [f for measure in layer.measures for f in _of_measure(layer.name, measure, bool(layer.gaps))]
    for gap in layer.gaps:
        if gap.tolerance is not None:
            agree = gap.value <= gap.tolerance
            found.append(
                Finding(
                    layer.name,
                    gap.subject,
                    gap.unit,
                    gap.first,
                    gap.second,
                    gap.value,
                    gap.tolerance,
                    agree,
                    gap.explanation,
                )
            )
    return found


def _of_measure(layer: str, m: Measure, has_gaps: bool) -> Iterator[Finding]:
    if m.tolerance is None:
        return
    if m.reference is not None:
        for engine, gap in errors(m).items():
            agree = gap <= m.tolerance
            yield Finding(layer, m.subject, m.unit, engine, ANALYTIC, gap, m.tolerance, agree, m.explanation)
        if has_gaps:
            return
    for a, b in combinations(m.values, 2):
        gap = abs(m.values[a] - m.values[b])
        allowed = m.tolerance * (1.0 if m.reference is None else 2.0)
        agree = gap <= allowed
        if a in m.intervals and b in m.intervals:
            (low_a, high_a), (low_b, high_b) = m.intervals[a], m.intervals[b]
            agree = low_a <= high_b and low_b <= high_a
        yield Finding(layer, m.subject, m.unit, a, b, gap, allowed, agree, m.explanation)


def declares(explanation: str, *engines: str) -> bool:
    """Whether an explanation has what one of these engines declares of itself."""
    return any(re.search(rf"(^|\W){re.escape(engine)} declares\b", explanation) for engine in engines)


def between(found: Iterable[Finding], first: str, second: str) -> list[Finding]:
    """The comparisons of two engines, or of one with the analytic answer."""
    return [f for f in found if {f.first, f.second} == {first, second}]


def worst(found: Iterable[Finding]) -> Finding | None:
    """The one furthest beyond (or nearest to) its tolerance, first of equals; None of nothing."""
    return max(found, key=lambda f: (not f.agree, f.ratio), default=None)


def disagreements(layers: Iterable[Layer]) -> list[Finding]:
    """All that is beyond its tolerance, the furthest first."""
    beyond = [f for layer in layers for f in findings(layer) if not f.agree]
    return sorted(beyond, key=lambda f: -f.ratio)

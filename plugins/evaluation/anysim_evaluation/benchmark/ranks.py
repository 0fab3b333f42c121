"""Rank agreement: whether two engines order policies alike; and means over tasks with how sure they are."""

from collections.abc import Sequence
from itertools import combinations, product
from math import sqrt

import numpy as np

Interval = tuple[float, float]

DRAWS = 2000
"""Resamplings of the tasks behind the interval of a mean."""


def kendall(first: Sequence[float], second: Sequence[float]) -> float | None:
    """Kendall's tau-b (1945), which heeds ties; None where one side has nothing but ties."""
    pairs = [(np.sign(a - b), np.sign(c - d)) for (a, c), (b, d) in combinations(zip(first, second, strict=True), 2)]
    ordered = sum(bool(x) for x, _ in pairs), sum(bool(y) for _, y in pairs)
    return float(sum(x * y for x, y in pairs)) / sqrt(ordered[0] * ordered[1]) if all(ordered) else None


def pearson(first: Sequence[float], second: Sequence[float]) -> float | None:
    """Pearson's correlation; None where one side is constant."""
    a, b = (np.asarray(side, dtype=float) - np.mean(side) for side in (first, second))
    scale = sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / scale if scale > 1e-12 else None


def mmrv(rates: Sequence[float], reference: Sequence[float]) -> float:
    """Mean maximum rank violation of SIMPLER (Li et al. 2024), in units of the reference's success rate; 0 is best.

    The mean over policies i of the largest |R_i - R_j| over the j whose order by `rates` is not that by `reference`. A
    tie on one side alone counts as a violation, as in SIMPLER's code. It is not symmetric.
    """
    n = len(rates)
    violated = [
        [abs(reference[i] - reference[j]) * ((rates[i] > rates[j]) != (reference[i] > reference[j])) for j in range(n)]
        for i in range(n)
    ]
    return float(np.mean([max(row) for row in violated]))


def mmrv_tolerant(
    rates: Sequence[float], reference: Sequence[float], spread: Sequence[Interval], reference_spread: Sequence[Interval]
) -> float:
    """`mmrv` where only an order counts that both sides are sure of: policies whose intervals overlap are equal."""
    n = len(rates)
    worst = [0.0] * n
    for i, j in product(range(n), range(n)):
        here, there = _order(spread[i], spread[j]), _order(reference_spread[i], reference_spread[j])
        if here * there < 0:
            worst[i] = max(worst[i], abs(reference[i] - reference[j]))
    return float(np.mean(worst))


def _order(a: Interval, b: Interval) -> int:
    """1 where a lies above b, -1 where below, 0 where they overlap."""
    return int(a[0] > b[1]) - int(b[0] > a[1])


def mean_interval(rates: Sequence[float]) -> Interval:
    """The 95 % interval of a mean over tasks: a bootstrap that draws whole tasks (the clusters), with a fixed seed."""
    generator = np.random.default_rng(0)
    drawn = generator.integers(len(rates), size=(DRAWS, len(rates)))
    low, high = np.quantile(np.asarray(rates, dtype=float)[drawn].mean(axis=1), (0.025, 0.975))
    return float(low), float(high)

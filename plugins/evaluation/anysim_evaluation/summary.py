"""Summaries of episodes: rates with intervals, and how far two engines agree on the same seeds."""

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import asdict
from itertools import combinations
from statistics import median
from typing import Any, TypeVar

from anysim.math.statistics import wilson
from anysim.task.contract import Status
from anysim_evaluation.driver import FAULT, Episode

K = TypeVar("K", bound=Hashable)
"""A seed, or a task and a seed."""


def summary(episodes: Sequence[Episode]) -> dict[str, Any]:
    """What became of episodes, as plain data.

    Faults of the simulation are counted apart and are no attempts. `interval` is Wilson's at 95 %; `steps` is the
    median over successes, None without any.
    """
    valid = [e for e in episodes if e.status != FAULT]
    won = [e for e in valid if e.status == Status.SUCCESS]
    failures = Counter(e.failure for e in valid if e.status != Status.SUCCESS)
    return {
        "attempts": len(valid),
        "successes": len(won),
        "success_rate": len(won) / len(valid) if valid else None,
        "interval": list(wilson(len(won), len(valid))),
        "failures": dict(sorted(failures.items(), key=lambda item: (-item[1], item[0]))),
        "faults": len(episodes) - len(valid),
        "steps": median(e.steps for e in won) if won else None,
        "episodes": [asdict(e) for e in sorted(episodes, key=lambda e: e.seed)],
    }


def agreement(a: Mapping[K, Episode], b: Mapping[K, Episode]) -> dict[str, Any]:
    """How far two engines, or two policies, agree on the seeds that both have run without a fault.

    `agree` is the share of seeds with the same outcome; `kappa` is Cohen's (1960), None where one outcome is all there
    is; `p` is McNemar's exact test of equal success (1947), two-sided, on the seeds that differ.
    """
    from scipy.stats import binomtest

    shared = [seed for seed in a if seed in b and FAULT not in (a[seed].status, b[seed].status)]
    pairs = [(a[seed].status == Status.SUCCESS, b[seed].status == Status.SUCCESS) for seed in shared]
    n, only_a, only_b = len(pairs), pairs.count((True, False)), pairs.count((False, True))
    if n == 0:
        return {"seeds": 0, "agree": None, "kappa": None, "only_first": 0, "only_second": 0, "p": None}
    observed = 1 - (only_a + only_b) / n
    first, second = sum(x for x, _ in pairs) / n, sum(y for _, y in pairs) / n
    chance = first * second + (1 - first) * (1 - second)
    differing = only_a + only_b
    return {
        "seeds": n,
        "agree": observed,
        "kappa": (observed - chance) / (1 - chance) if chance < 1 else None,
        "only_first": only_a,
        "only_second": only_b,
        "p": float(binomtest(only_a, differing).pvalue) if differing else 1.0,
    }


def agreements(by_engine: Mapping[str, Mapping[int, Episode]]) -> list[dict[str, Any]]:
    """The agreement of each two engines."""
    return [
        {"first": first, "second": second, **agreement(by_engine[first], by_engine[second])}
        for first, second in combinations(by_engine, 2)
    ]

"""Summaries of episodes: rates with intervals, and how far two engines agree on the same seeds."""

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import asdict
from itertools import combinations
from math import sqrt
from statistics import fmean, median
from typing import Any, TypeVar

from anysim.math.statistics import Z95, wilson
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
        **effort(valid),
        "ground": by_ground(valid),
        "episodes": [asdict(e) for e in sorted(episodes, key=lambda e: e.seed)],
    }


def by_ground(valid: Sequence[Episode]) -> list[dict[str, Any]]:
    """Successes by kind and level of the ground, episodes without faults; nothing where the ground has no tiles.

    The level is None in the rows of all levels of a kind, the kind is None in those of all kinds.
    """
    found: dict[tuple[str | None, int | None], list[bool]] = {}
    for e in valid:
        if e.ground is not None:
            for kind, level in ((e.ground, e.ground_level), (e.ground, None), (None, e.ground_level), (None, None)):
                found.setdefault((kind, level), []).append(e.status == Status.SUCCESS)
    return [
        {
            "kind": kind,
            "level": level,
            "attempts": len(won),
            "successes": sum(won),
            "interval": list(wilson(sum(won), len(won))),
        }
        for (kind, level), won in sorted(found.items(), key=lambda item: tuple((k is None, k) for k in item[0]))
    ]


def ground_table(rows: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[str]]]:
    """Columns and cells of what `by_ground` gives: a row for each kind, a column for each level, and all of them."""
    told = {(one["kind"], one["level"]): one for one in rows}
    kinds, levels = (sorted({key[k] for key in told}, key=lambda one: (one is None, one)) for k in (0, 1))

    def cell(one: Mapping[str, Any] | None) -> str:
        if one is None:
            return ""
        low, high = (100 * share for share in one["interval"])
        return f"{one['successes']}/{one['attempts']} ({low:.0f}-{high:.0f} %)"

    columns = ["ground", *("all levels" if level is None else f"level {level}" for level in levels)]
    return columns, [[kind or "all", *(cell(told.get((kind, level))) for level in levels)] for kind in kinds]


def effort(valid: Sequence[Episode]) -> dict[str, float | None]:
    """What successes took, of episodes without faults; None where there is no success, or nothing is said of it.

    `sim_s_per_success` and `retries_per_success` are those of all episodes, failed ones too, by the number of
    successes; `commands_done` is the mean share of a task's commands that were done.
    """
    won = sum(e.status == Status.SUCCESS for e in valid)
    retries = [e.retries for e in valid if e.retries is not None]
    shares = [e.done / e.required for e in valid if e.done is not None and e.required]
    return {
        "sim_s_per_success": sum(e.sim_s for e in valid) / won if won else None,
        "retries_per_success": sum(retries) / won if won and retries else None,
        "commands_done": fmean(shares) if shares else None,
    }


def gap_interval(only_first: int, only_second: int, n: int) -> tuple[float, float]:
    """The 95 % interval of a difference of two success rates on the same n seeds (Bonett and Price 2012).

    `only_first` and `only_second` are the seeds that one of the two alone has solved; no seeds say nothing: (-1, 1).
    """
    if n == 0:
        return -1.0, 1.0
    first, second = (only_first + 1) / (n + 2), (only_second + 1) / (n + 2)
    middle, half = first - second, Z95 * sqrt((first + second - (first - second) ** 2) / (n + 2))
    return max(-1.0, middle - half), min(1.0, middle + half)


def agreement(a: Mapping[K, Episode], b: Mapping[K, Episode]) -> dict[str, Any]:
    """How far two engines, or two policies, agree on the seeds that both have run without a fault.

    `agree` is the share of seeds with the same outcome; `kappa` is Cohen's (1960), None where one outcome is all there
    is; `gap` is how much more often the first succeeds, with its 95 % interval; `p` is McNemar's exact test of equal
    success (1947), two-sided, on the seeds that differ.
    """
    from scipy.stats import binomtest

    shared = [seed for seed in a if seed in b and FAULT not in (a[seed].status, b[seed].status)]
    pairs = [(a[seed].status == Status.SUCCESS, b[seed].status == Status.SUCCESS) for seed in shared]
    n, only_a, only_b = len(pairs), pairs.count((True, False)), pairs.count((False, True))
    if n == 0:
        return {"seeds": 0, "agree": None, "kappa": None, "only_first": 0, "only_second": 0} | dict.fromkeys(
            ("gap", "gap_interval", "p")
        )
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
        "gap": (only_a - only_b) / n,
        "gap_interval": list(gap_interval(only_a, only_b, n)),
        "p": float(binomtest(only_a, differing).pvalue) if differing else 1.0,
    }


def agreements(by_engine: Mapping[str, Mapping[int, Episode]]) -> list[dict[str, Any]]:
    """The agreement of each two engines."""
    return [
        {"first": first, "second": second, **agreement(by_engine[first], by_engine[second])}
        for first, second in combinations(by_engine, 2)
    ]

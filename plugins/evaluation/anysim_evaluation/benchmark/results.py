"""Results of a benchmark from its episodes: rates with intervals, paired tests, agreement, ranks, a matrix."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from statistics import fmean, median
from typing import Any, NamedTuple

from anysim.math.statistics import wilson
from anysim.task.contract import Status
from anysim_evaluation.benchmark.ranks import kendall, mean_interval, mmrv, mmrv_tolerant, pearson
from anysim_evaluation.driver import FAULT, Episode
from anysim_evaluation.summary import agreement, effort
from anysim_schemas.benchmark import BenchmarkSpec


class Cell(NamedTuple):
    """One policy on one engine and task, by the keys of the protocol."""

    task: str
    engine: str
    policy: str


Episodes = Mapping[Cell, Mapping[int, Episode]]
"""The episodes of each cell by their seeds."""


def figures(spec: BenchmarkSpec, found: Episodes) -> dict[str, Any]:
    """All tables of a benchmark as plain data; what was not run is left out."""
    rows = {cell: row(cell, found, spec) for cell in found if found[cell]}
    return {
        "rows": list(rows.values()),
        "means": list(_means(spec, rows)),
        "policies": list(_paired_policies(spec, found)),
        "engines": list(_paired_engines(spec, found)),
        "ranks": list(_ranks(spec, rows)),
        "matrix": list(_matrix(spec, rows)),
    }


def row(cell: Cell, found: Episodes, spec: BenchmarkSpec) -> dict[str, Any]:
    """Rates of one cell with Wilson's intervals at 95 %; success, failure and truncation sum up to 1.

    Faults of the simulation are counted apart and are no attempts. `length` is the mean over successes of the steps by
    the median steps of the reference; None without either. What successes took is told by `effort`. `outcomes` has a
    letter for each seed in order: s, f, t, and x for a fault.
    """
    episodes = [found[cell][seed] for seed in sorted(found[cell])]
    valid = [e for e in episodes if e.status != FAULT]
    counts = Counter(e.status for e in valid)
    won = [e.steps for e in valid if e.status == Status.SUCCESS]
    reference = found.get(Cell(cell.task, spec.reference.engine, spec.reference.policy), {})
    unit = [e.steps for e in reference.values() if e.status == Status.SUCCESS]
    told: dict[str, Any] = {**cell._asdict(), "attempts": len(valid), "faults": len(episodes) - len(valid)}
    for name, status in (("success", Status.SUCCESS), ("failure", Status.FAILED), ("truncation", Status.TRUNCATED)):
        told[name] = counts[status] / len(valid) if valid else None
        told[f"{name}_interval"] = list(wilson(counts[status], len(valid)))
    types = Counter(e.failure for e in valid if e.status != Status.SUCCESS)
    return told | {
        "failures": dict(sorted(types.items(), key=lambda item: (-item[1], item[0]))),
        "length": fmean(won) / median(unit) if won and unit else None,
        **effort(valid),
        "outcomes": "".join("x" if e.status == FAULT else str(e.status)[0] for e in episodes),
    }


Rows = Mapping[Cell, Mapping[str, Any]]


def _run(spec: BenchmarkSpec, rows: Rows, engine: str, policies: Sequence[str]) -> list[Mapping[str, Any]]:
    """The rows of policies on an engine, of the tasks that were run."""
    cells = (Cell(task, engine, policy) for policy in policies for task in spec.tasks)
    return [rows[cell] for cell in cells if cell in rows and rows[cell]["success"] is not None]


def _mean(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The mean success of rows with its interval: a bootstrap that draws rows, or Wilson's where there is one alone."""
    rates = [one["success"] for one in found]
    interval = list(mean_interval(rates)) if len(found) > 1 else found[0]["success_interval"]
    return {"success": fmean(rates), "interval": interval}


def _means(spec: BenchmarkSpec, rows: Rows) -> Iterator[dict[str, Any]]:
    """The mean success of each policy on each engine over the tasks, each task with the same weight."""
    for policy in spec.policies:
        for engine in spec.engines:
            if found := _run(spec, rows, engine, [policy]):
                yield {"engine": engine, "policy": policy, "tasks": len(found), **_mean(found)}


def _pooled(found: Episodes, engine: str, policies: Sequence[str], named: bool = True) -> dict[Any, Episode]:
    """Episodes of an engine by task, seed and, where `named`, policy."""
    return {
        (cell.task, cell.policy if named else "", seed): episode
        for cell, episodes in found.items()
        if cell.engine == engine and cell.policy in policies
        for seed, episode in episodes.items()
    }


def _paired_policies(spec: BenchmarkSpec, found: Episodes) -> Iterator[dict[str, Any]]:
    """Each policy against the reference, on the same tasks and seeds of each engine: McNemar's exact test."""
    first = spec.reference.policy
    for engine in spec.engines:
        for second in spec.policies:
            if second != first:
                sides = [_pooled(found, engine, [policy], named=False) for policy in (first, second)]
                told = agreement(*sides)
                if told["seeds"]:
                    yield {"engine": engine, "first": first, "second": second, **told}


def _paired_engines(spec: BenchmarkSpec, found: Episodes) -> Iterator[dict[str, Any]]:
    """Each two engines on the same tasks and seeds: by policy, and of all policies together (policy null)."""
    for first, second in combinations(spec.engines, 2):
        for policy in (*spec.policies, None):
            named = list(spec.policies) if policy is None else [policy]
            told = agreement(_pooled(found, first, named), _pooled(found, second, named))
            if told["seeds"]:
                yield {"first": first, "second": second, "policy": policy, **told}


def _ranks(spec: BenchmarkSpec, rows: Rows) -> Iterator[dict[str, Any]]:
    """Whether an engine orders the policies as the reference does: on each task, and by the means (task null)."""
    reference = spec.reference.engine
    for engine in spec.engines:
        if engine == reference:
            continue
        for task in (*spec.tasks, None):
            sides: list[tuple[float, float]] = []
            spreads: list[tuple[tuple[float, float], tuple[float, float]]] = []
            for policy in spec.policies:
                tasks = list(spec.tasks) if task is None else [task]
                cells = [(Cell(t, engine, policy), Cell(t, reference, policy)) for t in tasks]
                both = [
                    (rows[a], rows[b])
                    for a, b in cells
                    if a in rows and b in rows and rows[a]["success"] is not None and rows[b]["success"] is not None
                ]
                if not both:
                    continue
                here, there = ([pair[side]["success"] for pair in both] for side in (0, 1))
                sides.append((fmean(here), fmean(there)))
                if len(both) > 1:
                    spreads.append((mean_interval(here), mean_interval(there)))
                else:
                    a, b = (tuple(both[0][side]["success_interval"]) for side in (0, 1))
                    spreads.append((a, b))
            if len(sides) > 1:
                yield {"engine": engine, "reference": reference, "task": task} | _rank(sides, spreads)


def _rank(sides: Sequence[tuple[float, float]], spreads: Sequence[tuple[Any, Any]]) -> dict[str, Any]:
    here, there = [pair[0] for pair in sides], [pair[1] for pair in sides]
    spread, other = [pair[0] for pair in spreads], [pair[1] for pair in spreads]
    return {
        "policies": len(sides),
        "kendall": kendall(here, there),
        "pearson": pearson(here, there),
        "mmrv": mmrv(here, there),
        "mmrv_reversed": mmrv(there, here),
        "mmrv_tolerant": mmrv_tolerant(here, there, spread, other),
        "mmrv_tolerant_reversed": mmrv_tolerant(there, here, other, spread),
    }


def _matrix(spec: BenchmarkSpec, rows: Rows) -> Iterator[dict[str, Any]]:
    """Policies by the engine that they were trained on, and the engine that they are evaluated on."""
    for trained_on in spec.engines:
        trained = [name for name, policy in spec.policies.items() if policy.trained_on == trained_on]
        for engine in spec.engines:
            if found := _run(spec, rows, engine, trained):
                yield {"trained_on": trained_on, "engine": engine, "policies": trained, **_mean(found)}

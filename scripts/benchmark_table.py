"""The results of two benchmarks in docs/benchmark.md, from docs/benchmark.json and docs/transfer.json.

    python scripts/benchmark_table.py [--check]

The figures are made by these commands; the first goes on where it was cut off:

    anysim benchmark run core12 --workers 2 --out runs/core12
    cp runs/core12/results.json docs/benchmark.json
    cp runs/core12/costs.json docs/benchmark_costs.json

docs/transfer.json is made by those of its section. `--check` writes nothing and exits with 1 if the page has drifted
from these files.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import Any

from generated import ROOT, main

from anysim_evaluation.benchmark.page import agreement, matrix, ranks

STORE = ROOT / "docs" / "benchmark.json"
TRANSFER = ROOT / "docs" / "transfer.json"
COSTS = ROOT / "docs" / "benchmark_costs.json"
TOOK = {
    "length": ("length", ".2f"),
    "commands_done": ("commands done", ".0%"),
    "retries_per_success": ("retries", ".2f"),
    "sim_s_per_success": ("simulated s", ".1f"),
    "cpu_s_per_success": ("CPU s", ".2f"),
}
"""What is told of successes: of each figure its column and format."""


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of Markdown."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (columns, ["---"] * len(columns), *rows))


def percent(share: float | None) -> str:
    """A share, or nothing."""
    return "" if share is None else f"{share:.0%}"


def took(told: Mapping[str, Any], costs: Sequence[Mapping[str, Any]]) -> str:
    """What successes took on each engine with each policy: means over the tasks that have the figure."""
    spent = {(one["task"], one["engine"], one["policy"]): one["cpu_s_per_success"] for one in costs}
    found: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for one in told["rows"]:
        cpu_s = spent.get((one["task"], one["engine"], one["policy"]))
        found.setdefault((one["policy"], one["engine"]), []).append({**one, "cpu_s_per_success": cpu_s})
    rows: list[list[str]] = []
    for (policy, engine), cells in found.items():
        values = [[value for one in cells if (value := one.get(name)) is not None] for name in TOOK]
        if any(values):
            figures = (format(fmean(v), form) if v else "" for v, (_, form) in zip(values, TOOK.values(), strict=True))
            rows.append([f"`{policy}`", engine, *figures])
    return table(["policy", "engine", *(column for column, _ in TOOK.values())], rows)


def section() -> str:
    """What is said of the results."""
    told: Mapping[str, Any] = json.loads(STORE.read_text("utf-8"))
    costs = json.loads(COSTS.read_text("utf-8")) if COSTS.exists() else []
    engines = list(dict.fromkeys(one["engine"] for one in told["means"]))
    policies = list(dict.fromkeys(one["policy"] for one in told["means"]))
    means = {(one["policy"], one["engine"]): one for one in told["means"]}
    success = {(one["task"], one["policy"], one["engine"]): one["success"] for one in told["rows"]}
    versions = ", ".join(told["parts"][f"engines.{engine}"] for engine in engines)
    unfinished = f" {told['left']} episodes are still to be run." if told["left"] else ""
    by_mean = [
        [
            f"`{p}`",
            *("{:.0%} ({:.0%} to {:.0%})".format(means[p, e]["success"], *means[p, e]["interval"]) for e in engines),
        ]
        for p in policies
    ]
    by_task = [
        [f"`{task}`", *(" / ".join(percent(success.get((task, policy, e))) for e in engines) for policy in policies)]
        for task in dict.fromkeys(one["task"] for one in told["rows"])
    ]
    columns, orders = ranks({"ranks": [one for one in told["ranks"] if one["task"] is None]})
    pairs = agreement({"engines": [one for one in told["engines"] if one["policy"] is None]})
    return "\n\n".join(
        [
            f"The protocol `{told['protocol']}`, {told['episodes']} episodes of each task, engine and policy (seeds "
            f"{told['parts']['seeds']}), on {versions}; frozen as `{told['frozen'][:16]}`.{unfinished}",
            "Mean success over the tasks, with the interval of a bootstrap that draws whole tasks (it leaves out "
            "how few the episodes of each task are):",
            table(["policy", *engines], by_mean),
            f"Success by task on {', '.join(engines)}:",
            table(["task", *(f"`{policy}`" for policy in policies)], by_task),
            "What a success took, means over the tasks (the reference has a length of 1; CPU seconds are of one run):",
            took(told, costs),
            "Order of the policies by their means:",
            table(columns, orders),
            "Agreement of engines, seed by seed:",
            table(*pairs),
        ]
    )


def transfer() -> str:
    """Policies by the engine that they were trained on and the one they were evaluated on."""
    told: Mapping[str, Any] = json.loads(TRANSFER.read_text("utf-8"))
    said = f"{told['episodes']} episodes each (seeds {told['parts']['seeds']}), with Wilson's intervals at 95 %:"
    alike = "Agreement of the engines, seed by seed, of all policies together:"
    pairs = agreement({"engines": [one for one in told["engines"] if one["policy"] is None]})
    return "\n\n".join([said, table(*matrix(told)), alike, table(*pairs)])


if __name__ == "__main__":
    pages = ("docs/benchmark.md",)
    codes = [
        main(__doc__, *named)
        for named in (
            ("benchmark", "benchmark_table.py", pages, section),
            ("transfer", "benchmark_table.py", pages, transfer),
        )
    ]
    sys.exit(max(codes))

"""The page docs/collect.md: every task's expert on every engine, with intervals, failures and what an episode costs.

    python scripts/collect_table.py --episodes 64 --seed 90210

It takes a quarter of an hour. Nothing checks that the page is fresh: it is a measurement, not a generated file.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from anysim.math.statistics import wilson

PAGE = Path(__file__).parents[1] / "docs" / "collect.md"
ENGINES = ("mujoco", "pybullet", "sapien")
BEGIN, END = "<!-- measured: scripts/collect_table.py -->", "<!-- end -->"


class Row(NamedTuple):
    """One task on one engine. `cpu_s` is of the whole command, start-up included."""

    task: str
    engine: str
    attempts: int
    successes: int
    failures: dict[str, int]
    retried: int
    steps: float
    cpu_s: float


def measured(task: str, engine: str, episodes: int, seed: int) -> Row:
    """Collect in a process of its own, without cameras."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as out:
        command = [
            str(Path(sys.executable).with_name("anysim")),
            "run",
            task,
            "--engine",
            engine,
            "--num-envs",
            "16",
            "--json",
        ]
        command += ["--episodes", str(episodes), "--seed", str(seed), "-o", "record.cameras=[]", "--out", out]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if not done.stdout:
        raise SystemExit(f"{task} on {engine}: {done.stderr.strip()}")
    told: dict[str, Any] = json.loads(done.stdout)
    lost = [e for e in told["episodes"] if e["status"] != "success"]
    why = Counter(_failure(e) for e in lost)
    won = [e["steps"] for e in told["episodes"] if e["status"] == "success"]
    retried = sum("ladder" in e["outcome"] for e in told["episodes"])
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Row(
        task, engine, told["attempts"], told["successes"], dict(why), retried, median(won) if won else float("nan"), cpu
    )


def _failure(episode: dict[str, Any]) -> str:
    outcome = str(episode["outcome"].get("outcome", ""))
    return outcome if outcome not in ("", "running", "ok") else str(episode["status"])


def lines(rows: list[Row], episodes: int, seed: int) -> Iterator[str]:
    """The table."""
    yield f"{episodes} episodes of each in 16 envs, seed {seed}, without cameras; intervals are Wilson's at 95 %."
    yield ""
    yield "| task | engine | success | interval | failures | retried | steps | cpu s an episode kept |"
    yield "|---|---|---|---|---|---|---|---|"
    for row in rows:
        low, high = wilson(row.successes, row.attempts)
        failures = ", ".join(f"{count} {why}" for why, count in sorted(row.failures.items())) or "none"
        cost = f"{row.cpu_s / row.successes:.2f}" if row.successes else "none kept"
        yield (
            f"| {row.task} | {row.engine} | {row.successes} of {row.attempts} | {low:.0%} to {high:.0%} | {failures} | "
            f"{row.retried} | {row.steps:.0f} | {cost} |"
        )


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=64)
    parser.add_argument("--seed", type=int, required=True, help="one that nobody tuned to")
    parser.add_argument("--tasks", default="", help="separated by commas; all that have an expert if not given")
    chosen = parser.parse_args()
    from anysim import load, registry

    def solved(task: str) -> bool:
        spec = load(task).spec
        return spec.collect is not None or (spec.task is not None and spec.task.expert is not None)

    tasks = chosen.tasks.split(",") if chosen.tasks else [task for task in registry.names("tasks") if solved(task)]
    rows: list[Row] = []
    for task in tasks:
        for engine in ENGINES:
            rows.append(measured(task, engine, chosen.episodes, chosen.seed))
            print(*rows[-1], file=sys.stderr)
    table = "\n".join(lines(rows, chosen.episodes, chosen.seed))
    text = PAGE.read_text(encoding="utf-8")
    head, rest = text.split(BEGIN)
    PAGE.write_text(f"{head}{BEGIN}\n\n{table}\n\n{END}{rest.partition(END)[2]}", encoding="utf-8")


if __name__ == "__main__":
    main()

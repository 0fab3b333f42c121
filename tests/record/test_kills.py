"""kill -9 at random moments of a run, of a worker, of both: nothing partial, equal when resumed, counted once."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim_inspect.verify import verify_run
from tests.record.killed_runs import ENVS, EPISODES, Order

ROOT = Path(__file__).parents[2]
Ordered = Callable[[Order], dict[str, Any]]


@pytest.fixture
def ordered() -> Iterator[Ordered]:
    """Runs as `Order` says, and what came of them."""
    command = [sys.executable, "-m", "tests.record.killed_runs"]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:

        def one(order: Order) -> dict[str, Any]:
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write(json.dumps(order._asdict()) + "\n")
            process.stdin.flush()
            answer = json.loads(process.stdout.readline())
            assert "error" not in answer, answer["error"]
            return answer

        yield one
        assert process.stdin is not None
        process.stdin.close()
        assert process.wait(30) == 0


def manifests(out: Path) -> dict[str, dict[str, Any]]:
    """Everything that equal trajectories share, with the hashes of their files."""
    found: dict[str, dict[str, Any]] = {}
    for path in sorted((out / "episodes").glob("*/manifest.json")):
        found[path.parent.name] = {k: v for k, v in json.loads(path.read_text()).items() if k != "clock"}
    return found


def killed(ordered: Ordered, folder: Path, victim: str, moments: int, seed: int) -> None:
    """Kill at random moments, each in a run of its own, and look at what is left and at what comes of it."""
    shards = 1 if victim == "run" else 2
    whole = folder / "whole"
    calm = ordered(Order(str(whole), shards))
    wanted, rng = manifests(whole), np.random.default_rng(seed)
    assert len(wanted) == EPISODES
    assert calm["warnings"] == sum(r["reruns"] for r in calm["results"]) == 0
    survived: list[int] = []
    counted = 0
    for moment in range(moments):
        out = folder / f"run_{moment}"
        delay, between = rng.uniform(0.0, [calm["seconds"], 0.05]).tolist()
        first = Order(str(out), shards, victim, delay, between, int(rng.integers(shards)))
        answer = ordered(first)
        there = manifests(out)
        if (out / "episodes").is_dir():
            faults = verify_run(out)
            assert not any(faults.values()), (first, faults)
            assert len(faults) == len(there), first
        assert all(wanted[name] == manifest for name, manifest in there.items()), first
        if victim == "worker":
            assert answer["status"] == 0, first
            counted += once(answer, first)
        survived.append(len(there))
        if victim != "worker":
            again = ordered(Order(str(out), shards))
            resumed = {(r["env"], r["episode"]) for r in again["results"] if r["resumed"]}
            assert len(resumed) == len(there), first
            assert len(again["results"]) == EPISODES
            assert all(r["reruns"] == 0 and not r["lost"] for r in again["results"]), first
        assert manifests(out) == wanted, first
        assert sorted(p.name for p in out.iterdir()) == ["episodes", "run.json"], first
    print(f"{moments} kills of {victim}: {sorted(survived)} of {EPISODES} were there, {counted} begun anew")
    if victim == "worker":
        assert counted > moments // 10, "most kills come too early or too late"
    else:
        assert sum(0 < count < EPISODES for count in survived) > moments // 10, "the moments are not spread"


def once(answer: dict[str, Any], order: Order) -> int:
    """A lost worker is told once, and each episode that was running in it is begun anew once; how many there were."""
    again = [r for r in answer["results"] if r["reruns"]]
    assert len(answer["results"]) == EPISODES, order
    assert not any(r["lost"] for r in answer["results"]), order
    assert all(r["reruns"] == 1 for r in again), order
    block = range(order.worker * ENVS // order.shards, (order.worker + 1) * ENVS // order.shards)
    assert all(r["env"] in block for r in again), order
    assert len({r["env"] for r in again}) == len(again), order
    assert answer["warnings"] in ((1,) if again else (0, 1)), order
    return len(again)


@pytest.mark.full
@pytest.mark.parametrize("victim", ["run", "worker", "both"])
def test_a_hundred_kills(ordered: Ordered, tmp_path: Path, victim: str) -> None:
    killed(ordered, tmp_path, victim, 100, seed=len(victim))


@pytest.mark.slow
def test_some_kills(ordered: Ordered, tmp_path: Path) -> None:
    killed(ordered, tmp_path, "run", 10, seed=1)

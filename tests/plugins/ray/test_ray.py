"""Jobs on a Ray cluster of two nodes of one machine (`make test-ray`): equal results, lost nodes, and errors."""

import json
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

pytest.importorskip("ray")

from anysim.errors import RecordError, TaskError
from anysim_collect.mixture import Limits
from anysim_collect.sharing import SharedCollection, collect_shared, shared_job
from anysim_evaluation.cli import evaluate as evaluate_cli
from anysim_processes.executors import job_executor
from anysim_ray import crew, node
from tests.plugins.collect.test_interrupted import manifests
from tests.plugins.processes.test_commands import short_run, written
from tests.plugins.ray.cluster_help import add, cluster_of, kill

pytestmark = pytest.mark.filterwarnings("default")  # of Ray's own
EPISODES, KILLS = 64, 10
EXPORT = ["--to", "webdataset", "--option", "images=false"]
TASK = ["reach", "-n", "2", "-s", "4", "-k", str(EPISODES), "-o", "record.cameras=[]"]


@pytest.fixture(scope="module")
def cluster() -> Iterator[tuple[Any, list[Any]]]:
    with cluster_of(2) as made:
        yield made


@contextmanager
def waiting() -> Iterator[Callable[[int], int]]:
    def wait(number: int) -> int:
        time.sleep(0.2)
        return number

    yield wait


@contextmanager
def refusing() -> Iterator[Callable[[int], int]]:
    def refuse(number: int) -> int:
        raise TaskError(f"the number {number} is odd")

    yield refuse


@contextmanager
def dying() -> Iterator[Callable[[int], int]]:
    import os

    yield lambda number: os._exit(1)


def command(*words: object) -> Any:
    program = [sys.executable, "-m", "anysim.cli", *map(str, words)]
    return subprocess.run(program, capture_output=True, text=True, timeout=900, check=False)


def test_trajectories_survive_nodes_that_are_killed(cluster: Any, tmp_path: Path) -> None:
    made, nodes = cluster
    alone = tmp_path / "alone"
    found = command("run", *TASK, "--out", alone)
    assert found.returncode == 0, found.stderr
    job, _ = shared_job("reach", None, 2, 4, ["record.cameras=[]"])
    out, rng = tmp_path / "shared", np.random.default_rng(7)
    moments = np.sort(rng.choice(np.arange(EPISODES - 6), KILLS, replace=False)).tolist()
    killers: list[threading.Thread] = []
    seen: list[tuple[int, int]] = []

    def kill_one(delay: float, place: int) -> None:
        time.sleep(delay)
        kill(made, nodes.pop(place))

    def tell(task: str, result: Any) -> None:
        seen.append((result.env, result.episode))
        if len(killers) < KILLS and len(seen) > moments[len(killers)]:
            if killers:
                killers[-1].join()
                nodes.append(add(made, 1))  # Ray wants the main thread for it
            killers.append(threading.Thread(target=kill_one, args=(rng.uniform(0.0, 0.5), int(rng.integers(2)))))
            killers[-1].start()

    collection = SharedCollection(job._replace(episodes=EPISODES), out, 1.0, EPISODES)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            collect_shared([collection], Limits(), "ray:tries=20", None, tell)
    finally:
        collection.keeper.close()
        for one in killers:
            one.join()
        nodes.append(add(made, 1))
    lost = [one for one in caught if issubclass(one.category, crew.WorkerWarning)]
    print(f"{len(killers)} nodes killed, {len(lost)} items done again")
    assert len(killers) == KILLS
    assert lost
    assert sorted(seen) == [(env, k) for env in range(2) for k in range(EPISODES // 2)]
    assert collection.tally.attempts == EPISODES
    assert manifests(out) == manifests(alone)
    assert (out / "run.json").read_bytes() == (alone / "run.json").read_bytes()


def test_evaluations_are_equal(cluster: Any, tmp_path: Path) -> None:
    app = typer.Typer()
    app.command()(evaluate_cli.evaluate)
    words = ["reach", "-k", "6", "-p", "expert:sigma=0.5"]
    for out, more in (("alone", []), ("ray", ["--executor", "ray", "-n", "2"])):
        found = CliRunner().invoke(app, [*words, "--out", str(tmp_path / out), *more])
        assert found.exit_code == 0, found.output
    alone, shared = (tmp_path / out / "evaluation.json" for out in ("alone", "ray"))
    assert alone.read_bytes() == shared.read_bytes()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory, command_line: typer.Typer) -> Path:
    return short_run(command_line, tmp_path_factory.mktemp("recorded") / "run")


@pytest.mark.parametrize(
    "words",
    [
        ["render", "RUN", "-c", "front"],
        ["render", "RUN", "-c", "front", "--annotate", "boxes_2d"],
        ["render", "stills.yaml", "--out", "OUT"],
        ["benchmark", "run", "tiny.yaml", "--out", "OUT"],
    ],
    ids=["films", "annotations", "stills", "benchmark"],
)
def test_films_stills_and_benchmarks_are_equal(
    words: list[str], cluster: Any, command_line: typer.Typer, recorded: Path, tmp_path: Path
) -> None:
    alone = written(words, command_line, recorded, tmp_path / "alone")
    shared = written([*words, "--executor", "ray"], command_line, recorded, tmp_path / "shared")
    assert shared == alone


def test_a_run_at_an_address_exports_the_same(cluster: Any, tmp_path: Path) -> None:
    address = f"ray:address={cluster[0].address}"
    run = ["run", "reach", "-n", 1, "-k", 2, "-o", "record.cameras=[]"]
    for name, more in (("alone", []), ("ray", ["--executor", address])):
        for words in (
            [*run, "--out", tmp_path / name],
            ["export", tmp_path / name, *EXPORT, "--out", tmp_path / f"{name}.set"],
        ):
            found = command(*words, *more)
            assert found.returncode == 0, found.stderr
    assert manifests(tmp_path / "alone") == manifests(tmp_path / "ray")
    sets = [sorted((tmp_path / f"{name}.set").rglob("*")) for name in ("alone", "ray")]
    assert [path.name for path in sets[0]] == [path.name for path in sets[1]]
    for one, other in zip(*sets, strict=True):
        if one.suffix == ".tar":
            assert one.read_bytes() == other.read_bytes(), one.name


def test_items_come_once_and_as_they_are_done(cluster: Any) -> None:
    assert sorted(job_executor("ray").treat_all([(n,) for n in range(12)], waiting)) == list(range(12))
    assert list(job_executor("ray").treat_all([], waiting)) == []
    some = job_executor("ray").treat_all(((n,) for n in range(1000)), waiting, 1)
    assert [next(some), next(some)] == [0, 1]
    some.close()


def test_what_goes_wrong_is_told(cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RecordError, match=r"the number 1 is odd \(on the node"):
        list(job_executor("ray").treat_all([(1,)], refusing))
    with (
        pytest.warns(crew.WorkerWarning, match="item 0 is done again"),
        pytest.raises(RecordError, match="item 0 lost its worker 2 times"),
    ):
        list(job_executor("ray:tries=2").treat_all([(1,)], dying))
    (tmp_path / "only_here.py").write_text("def opened(): ...\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    import only_here  # pyright: ignore[reportMissingImports]

    monkeypatch.setattr(sys, "path", [part for part in sys.path if part != str(tmp_path)])
    with pytest.raises(RecordError, match="the module 'only_here' is missing on the node"):
        list(job_executor("ray").treat_all([(1,)], only_here.opened))
    there = node.packages()
    monkeypatch.setattr(crew, "packages", lambda: there | {"anysim": "0.0.9"})
    with pytest.raises(TaskError, match=r"other versions: anysim .* \(here 0.0.9\); install the same on every node"):
        list(job_executor("ray").treat_all([(1,)], waiting))


def test_a_cluster_without_room_ends_the_job(cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crew, "START_S", 2.0)
    with pytest.raises(TaskError, match="no node of the cluster has room for a worker of 64 CPUs"):
        list(job_executor("ray:num_cpus=64").treat_all([(1,)], waiting))


def test_an_address_where_nothing_is(tmp_path: Path) -> None:
    found = command("run", "reach", "--out", tmp_path / "run", "--executor", "ray:address=127.0.0.1:9")
    assert found.returncode == 2
    assert "no Ray cluster answers at 127.0.0.1:9" in found.stderr
    assert json.dumps(found.stderr).count("Traceback") == 0

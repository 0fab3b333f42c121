"""`anysim run --executor`: workers run rounds of episodes, and the trajectories are those of a run in one process."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from anysim.errors import RecordError
from anysim.record.manifest import RunRecord, read_run
from anysim_collect import sharing
from anysim_collect.cli import run as cli
from anysim_collect.report import read_report
from anysim_collect.rounds import running_rounds
from anysim_collect.sharing import Keeper, shared_job
from anysim_processes import executors
from tests.plugins.collect.test_interrupted import manifests
from tests.plugins.processes.pickling import Pickling

EPISODES = 7
TASK = ["reach", "-n", "3", "-s", "4", "-o", "record.cameras=[]"]
app = typer.Typer()
app.command()(cli.run)


def run(*words: object) -> Any:
    return CliRunner().invoke(app, [*TASK, *map(str, words)])


@pytest.fixture(autouse=True)
def pickling(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executors, "job_executor", lambda name: Pickling())
    Pickling.items = 0


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("alone") / "run"
    assert run("-k", EPISODES, "--out", out).exit_code == 0
    return out


def test_trajectories_do_not_depend_on_who_runs_them(alone: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    found = run("-k", EPISODES, "--out", out, "--executor", "pickling")
    assert found.exit_code == 0, found.output
    assert manifests(out) == manifests(alone)
    assert len(manifests(out)) == EPISODES
    assert (out / "run.json").read_bytes() == (alone / "run.json").read_bytes()
    assert not (out / ".incoming").exists()
    mine, theirs = read_report(out), read_report(alone)
    assert mine.keys() == theirs.keys()
    for key in ("task", "attempts", "successes", "kept", "steps", "commands", "engine_version"):
        assert mine[key] == theirs[key], key

    for name in ("env_0001_episode_0000", "env_0002_episode_0001"):
        shutil.rmtree(out / "episodes" / name)
    Pickling.items = 0
    again = run("-k", EPISODES, "--out", out, "--executor", "pickling", "--json")
    assert again.exit_code == 0, again.output
    told = json.loads(again.output)
    assert Pickling.items == 2
    assert sum(one["resumed"] for one in told["episodes"]) == EPISODES - 2
    assert manifests(out) == manifests(alone)


def test_the_directory_is_that_of_a_run_here(alone: Path) -> None:
    job, out = shared_job("reach", None, 3, 4, ["record.cameras=[]"])
    here = read_run(alone)
    assert out.name == sharing.run_name("reach", "mujoco", here.spec, 4)
    assert (job.engine, job.num_envs, job.seed) == ("mujoco", 3, 4)


def test_a_worker_of_other_versions_is_refused(alone: Path, tmp_path: Path) -> None:
    record = read_run(alone)
    keeper = Keeper(tmp_path)
    try:
        assert keeper.keep(record, []) == []
        other = RunRecord.model_validate({**dict(record), "engine_version": "mujoco 0.0.1"})
        with pytest.raises(RecordError, match="engine_version differs"):
            keeper.keep(other, [])
        with pytest.raises(RecordError, match="another run"):
            Keeper(tmp_path)
    finally:
        keeper.close()


def test_nothing_is_handed_out_once_there_is_enough(tmp_path: Path) -> None:
    found = run("--bytes", "1", "--out", tmp_path / "run", "--executor", "pickling", "--workers", 1)
    assert found.exit_code == 0, found.output
    assert "ended at the limit of 1 bytes" in found.output
    assert Pickling.items == 2
    assert len(manifests(tmp_path / "run")) == 6


def test_a_view_is_of_envs_that_are_here(tmp_path: Path) -> None:
    found = run("--view", "--executor", "pickling", "--out", tmp_path / "run")
    assert found.exit_code != 0
    assert "--view shows envs of this process" in str(found.exception)


def test_what_a_killed_worker_left_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("anysim_collect.rounds.gettempdir", lambda: str(tmp_path))
    job, _ = shared_job("reach", None, 1, 4, ["record.cameras=[]"])
    with running_rounds() as made:
        one = made(job._replace(episodes=1), 0, frozenset())
        [root] = tmp_path.iterdir()
        assert not list(root.iterdir())
        (root / "dead").mkdir()
        (root / "dead.lock").touch()
        two = made(job._replace(episodes=1), 0, frozenset())
        assert not list(root.iterdir())
    assert one.episodes[0].result == two.episodes[0].result
    assert one.episodes[0].files.keys() == two.episodes[0].files.keys()

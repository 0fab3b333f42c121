"""Recordings of planned moves: the same however many envs run and workers plan, and replayed bit for bit."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from anysim import make
from anysim.planning.service import SERVICE_VARIABLE
from anysim.record.manifest import read_manifest
from anysim.record.names import EPISODES, trajectory_name
from anysim.record.replay import replay
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from anysim_collect.cli.run import run
from anysim_recording.collector import Collector
from anysim_skills.planning import WORKERS_VARIABLE

WALL = Path(__file__).parent / "worlds/behind_wall.yaml"


def collected(out: Path, num_envs: int, shared: int) -> list[dict[str, Any]]:
    """The manifests of the envs that all runs have, without what may differ between equal runs."""
    with make(WALL, engine="mujoco", num_envs=num_envs, overrides=["record.keep=all"]) as env:
        results = list(Collector(env, SkillPolicy(env), out, num_envs, seed=5).run())
    assert sum(result.success for result in results) >= 0.75 * num_envs
    return manifests(out, shared)


def manifests(out: Path, shared: int) -> list[dict[str, Any]]:
    manifests = [read_manifest(out / EPISODES / trajectory_name(i, 0)).to_dict() for i in range(shared)]
    return [{key: value for key, value in manifest.items() if key != "clock"} for manifest in manifests]


@pytest.mark.slow
def test_recordings_depend_neither_on_workers_nor_on_other_envs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs: dict[tuple[int, str], list[dict[str, Any]]] = {}
    for num_envs, workers in ((4, "1"), (4, "2"), (16, "2")):
        monkeypatch.setenv(WORKERS_VARIABLE, workers)
        runs[num_envs, workers] = collected(tmp_path / f"{num_envs}_{workers}", num_envs, 4)
    first, same, more = runs.values()
    assert first[0]["outcome"]["planner"] == {"name": "rrt", "version": "1", "latency": 5}
    assert first == same
    for manifest in (*first, *more):
        assert manifest["spec"].pop("num_envs") in (4, 16)
        del manifest["files"]  # the number of envs is in them too
    assert first == more
    drift = replay(tmp_path / "4_1" / EPISODES / trajectory_name(0, 0)).drift
    assert drift.identical, str(drift)


@pytest.mark.slow
@pytest.mark.parametrize(
    "engine", ["mujoco", *(pytest.param(name, marks=pytest.mark.full) for name in ("pybullet", "sapien"))]
)
def test_runs_from_the_command_line_are_the_same(engine: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    require_engine(engine)
    app, runs = typer.Typer(), list[list[dict[str, Any]]]()
    app.command("run")(run)
    kinds = [(4, "1", "processes"), (4, "2", "threads"), (16, "2", "")]
    if engine == "mujoco":
        kinds[1:1] = [(4, "1", "processes"), (4, "2", "processes")]
    for number, (num_envs, workers, service) in enumerate(kinds):
        monkeypatch.setenv(WORKERS_VARIABLE, workers)
        monkeypatch.setenv(SERVICE_VARIABLE, service)
        size = ["--num-envs", str(num_envs), "--episodes", str(num_envs)]
        words = [str(WALL), "--engine", engine, *size, "--seed", "5", "--out", str(tmp_path / str(number))]
        done = CliRunner().invoke(app, [*words, "-o", "record.keep=all", "--min-success", "0.75", "--json"])
        assert done.exit_code == 0, done.output
        runs.append(manifests(tmp_path / str(number), 4))
    for one, other in pairwise(runs[:-1]):
        assert one == other
    for manifest in (*runs[0], *runs[-1]):
        assert manifest["engine"] == engine
        assert manifest["spec"].pop("num_envs") in (4, 16)
        del manifest["files"]  # the number of envs is in them too
    assert runs[0] == runs[-1]

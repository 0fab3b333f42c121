"""Collecting: what is told of an episode and when, what a broken disk does, and where the time goes."""

import errno
from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim import registry
from anysim.errors import RecordError
from anysim.record.columns import EpisodeColumns
from anysim.record.manifest import read_manifest
from anysim.record.writer import TrajectoryWriter, WrittenFile
from anysim.skills.runner import SkillPolicy
from anysim_recording.collector import Collector
from tests.task.helpers import BLIND

SHORT = [*BLIND, "record.keep=all", "task.horizon=6"]


class NpzWriter(TrajectoryWriter):
    """The writer of the documentation."""

    name = "npz"
    seen: list[EpisodeColumns] = []  # noqa: RUF012  emptied by the fixture
    full_from = -1

    def write(self, directory: Path, columns: EpisodeColumns, status: str) -> tuple[WrittenFile, ...]:
        if len(self.seen) == self.full_from:
            raise OSError(errno.ENOSPC, "No space left on device")
        self.seen.append(columns)
        np.savez(directory / "trajectory.npz", time=columns.time, action=columns.action, **columns.state)  # pyright: ignore[reportArgumentType]
        return (WrittenFile("trajectory.npz"),)


@pytest.fixture
def npz(monkeypatch):
    load = registry.load
    monkeypatch.setattr(NpzWriter, "seen", [])
    monkeypatch.setattr(NpzWriter, "full_from", -1)
    monkeypatch.setattr(
        registry, "load", lambda kind, name: NpzWriter if (kind, name) == ("writers", "npz") else load(kind, name)
    )
    return NpzWriter


@pytest.fixture
def env(npz):
    with anysim.make("pick_cube", engine="null", num_envs=3, overrides=SHORT) as env:
        env.spec = env.spec.model_copy(update={"record": env.spec.record.model_copy(update={"writer": "npz"})})
        yield env


def test_an_episode_is_told_when_its_trajectory_is_there(tmp_path, env, npz) -> None:
    collector = Collector(env, SkillPolicy(env), tmp_path, 7, 1)
    told = []
    for result in collector.run():
        assert result.path is not None
        assert read_manifest(result.path).steps == result.steps == 6
        assert (result.path / "trajectory.npz").is_file()
        told.append((result.env, result.episode))
    assert sorted(told) == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (2, 0), (2, 1)]
    assert len(npz.seen) == 7
    columns = npz.seen[0]
    assert (len(columns), columns.first_step, columns.steps) == (7, 0, 6)
    assert np.array_equal(
        columns.time, np.load(collector.recorder.out / "episodes/env_0000_episode_0000/trajectory.npz")["time"]
    )
    assert [change.row for change in columns.status] == [0, 6]
    assert columns.nbytes > 7 * 8 * columns.state["body_pose"][0].size


def test_a_second_run_tells_what_is_there_and_writes_the_rest(tmp_path, env, npz) -> None:
    first = [result.path for result in Collector(env, SkillPolicy(env), tmp_path, 3, 1).run()]
    results = list(Collector(env, SkillPolicy(env), tmp_path, 6, 1).run())
    assert [result.path for result in results if result.resumed] == sorted(first)
    assert len(npz.seen) == 6
    assert len(results) == 6


def test_a_full_disk_ends_the_run_and_leaves_whole_trajectories(tmp_path, env, npz) -> None:
    npz.full_from = 4
    told = []
    with pytest.raises(RecordError, match=r"cannot commit env \d, episode \d: No space left on device .* Make room"):
        told.extend(Collector(env, SkillPolicy(env), tmp_path, 60, 1).run())
    there = sorted(path for path in (tmp_path / "episodes").iterdir())
    assert 4 <= len(there) < 60
    for path in there:
        assert read_manifest(path).steps == 6
    assert not (tmp_path / ".incoming").exists()


def test_a_caller_that_stops_iterating_loses_only_what_was_running(tmp_path, env) -> None:
    run = Collector(env, SkillPolicy(env), tmp_path, 3000, 1).run()
    next(run)
    run.close()
    there = list((tmp_path / "episodes").iterdir())
    assert 1 <= len(there) < 3000
    for path in there:
        read_manifest(path)
    assert not (tmp_path / ".incoming").exists()


def test_the_parts_of_the_time_add_up(tmp_path, env) -> None:
    collector = Collector(env, SkillPolicy(env), tmp_path, 4, 1)
    steps = sum(result.steps for result in collector.run())
    assert collector.times.steps == steps
    parts = collector.times.parts()
    assert parts["physics"] > 0
    assert parts["record"] > 0
    assert parts["draw"] == 0
    assert all(seconds >= 0 for seconds in parts.values())

"""The directory of a run: what cannot be one is said, and two runs do not spend their time on the same episodes."""

import os
from pathlib import Path

import pytest

import anysim
from anysim.errors import RecordError
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim_recording.collector import Collector
from tests import forked
from tests.task.helpers import BLIND

SHORT = [*BLIND, "record.keep=all", "task.horizon=3"]


def collector(env: TaskEnv, out: Path) -> Collector:
    return Collector(env, SkillPolicy(env), out, 2, 1)


@pytest.fixture
def env():
    with anysim.make("pick_cube", engine="null", overrides=SHORT) as env:
        yield env


@pytest.mark.parametrize("name", ["file", "file/below", "file/below/it"])
def test_a_file_is_no_directory(env, name: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(RecordError, match=r"file is a file, not a directory; name a directory"):
        collector(env, tmp_path / name)
    assert (tmp_path / "file").read_text() == "mine"


def test_a_name_that_is_too_long_is_no_lack_of_room(env, tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="name another directory") as told:
        collector(env, tmp_path / ("x" * 300))
    assert "Make room" not in str(told.value)


def test_the_command_says_it_before_it_builds_anything(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    done = forked.run("-m", "anysim.cli", "run", "no_such_task", "--out", str(tmp_path / "file"))
    assert done.returncode == 2
    assert "is a file, not a directory" in done.stderr


def test_a_second_run_into_a_directory_is_refused_before_it_starts(env, tmp_path: Path) -> None:
    first = collector(env, tmp_path)
    running = first.run()
    next(running)
    with pytest.raises(RecordError, match=rf"another run \(process {os.getpid()} on .*\) is recording into .* wait"):
        collector(env, tmp_path)
    assert len(list(running)) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["episodes", "run.json"]
    assert [result.resumed for result in collector(env, tmp_path).run()] == [True, True]


def test_a_run_that_was_killed_or_never_begun_holds_nothing(env, tmp_path: Path) -> None:
    collector(env, tmp_path)  # dropped at once
    (tmp_path / ".collecting.lock").write_text("process 1 on a machine that lost its power")
    assert len(list(collector(env, tmp_path).run())) == 2

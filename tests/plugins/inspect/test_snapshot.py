"""`anysim snapshot`: what a file belongs to, and a sentence where it is none."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from anysim.engine.snapshots.file import read
from anysim.errors import NameLookupError, SnapshotError
from tests.plugins.inspect.commands import app
from tests.runtime import light


def test_show_prints_the_stamp(tmp_path: Path) -> None:
    with light.make("null", 2) as env:
        env.reset(seed=1)
        path = env.snapshot().save(tmp_path / "a.snapshot")
        seeds = env.streams.episode_seed.tolist()
        env.engine.world_state().save(tmp_path / "b.state")
    said = CliRunner().invoke(app, ["snapshot", "show", str(path), "--json"])
    found = json.loads(said.stdout)
    assert found["kind"] == "env snapshot"
    assert found["stamp"]["engine"] == "null"
    assert found["stamp"]["episode_seeds"] == seeds
    assert found["bytes"] == path.stat().st_size
    assert found["arrays"]["engine/ticks"] == "int64 (2,)"
    table = CliRunner().invoke(app, ["snapshot", "show", str(tmp_path / "b.state")])
    assert "kind\tworld state" in table.stdout
    path.write_bytes(path.read_bytes()[:-40])
    broken = CliRunner().invoke(app, ["snapshot", "show", str(path)])
    assert isinstance(broken.exception, SnapshotError)
    with pytest.raises(SnapshotError, match="damaged or truncated"):
        raise broken.exception


def test_a_moment_of_a_run_is_taken_from_its_first_trajectory_or_the_one_named(recorded: Path, tmp_path: Path) -> None:
    def take(source: Path, name: str, *more: str) -> str:
        done = CliRunner().invoke(app, ["snapshot", "take", str(source), str(tmp_path / name), "--step", "3", *more])
        assert done.exit_code == 0, done.output
        return done.stdout

    first, second = sorted((recorded / "episodes").iterdir())
    assert f"step 3 of {first.name} (the first of 2; --trajectory names another)" in take(recorded, "run")
    assert f"step 3 of {first.name}, on" in take(first, "first")
    assert f"step 3 of {second.name}, on" in take(recorded, "second", "--trajectory", second.name)
    seeds = [read(tmp_path / name).stamp["episode_seeds"] for name in ("run", "first", "second")]
    assert seeds[0] == seeds[1] != seeds[2]
    wrong = CliRunner().invoke(app, ["snapshot", "take", str(recorded), "x", "--trajectory", first.name[:-1] + "7"])
    with pytest.raises(NameLookupError, match=f"did you mean '{first.name}'"):
        raise wrong.exception or AssertionError(wrong.output)

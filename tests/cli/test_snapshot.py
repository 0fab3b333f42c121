"""`anysim snapshot`: what a file belongs to, and a sentence where it is none."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from anysim.cli.main import app
from anysim.errors import SnapshotError
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

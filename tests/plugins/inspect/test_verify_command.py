"""`anysim verify`: which trajectories of a run are whole."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from anysim.record.incoming import FileLock
from anysim_mcap.reader import McapReader
from tests.plugins.inspect.commands import app


def test_a_changed_byte_is_named_and_the_other_trajectory_is_whole(recorded: Path, tmp_path: Path) -> None:
    whole = CliRunner().invoke(app, ["verify", str(recorded)])
    assert whole.exit_code == 0, whole.output
    assert whole.output.splitlines()[-1] == "2 of 2 trajectories are whole"
    run = Path(shutil.copytree(recorded, tmp_path / "run"))
    first = sorted((run / "episodes").iterdir())[0]
    file = max((one for one in first.iterdir() if one.suffix != ".json"), key=lambda one: one.stat().st_size)
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    said = CliRunner().invoke(app, ["verify", str(run), "--json"])
    found = json.loads(said.stdout)
    assert said.exit_code == 1
    assert found["verified"] == 2
    assert list(found["damaged"]) == [str(first)]
    assert "was changed after its commit" in found["damaged"][str(first)][0]


@pytest.fixture
def run(recorded: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(recorded, tmp_path / "run"))


def verified(*words: str | Path) -> tuple[int, dict[str, Any]]:
    said = CliRunner().invoke(app, ["verify", *map(str, words), "--json"])
    return said.exit_code, json.loads(said.stdout)


def edit(file: Path, change: Callable[[dict[str, Any]], object]) -> None:
    data = json.loads(file.read_text())
    change(data)
    file.write_text(json.dumps(data))


def test_what_was_left_half_written_is_listed_and_no_damage(run: Path) -> None:
    (run / ".incoming" / "env_0000_episode_0007.99-0").mkdir(parents=True)
    (run / ".incoming" / "env_0001_episode_0007.98-0").mkdir()
    (run / "episodes" / ".env_0000_episode_0000.film").mkdir()
    (run / "episodes" / "env_0000_episode_0000.annotations").mkdir()  # those of `anysim render` are none
    (run / "episodes" / "copy of one").mkdir()
    with FileLock.take(run / ".incoming" / "98-0.lock") or pytest.fail("locked"):  # that one is being written
        code, found = verified(run)
    [left] = [check["left"] for check in found["runs"]]
    assert (code, found["damaged"]) == (0, {})
    assert left == [
        f"{run / '.incoming'} holds what an interrupted run has left of 1 trajectory (env_0000_episode_0007.99-0): the "
        f"same `anysim run` removes it and goes on, or remove {run / '.incoming'}",
        f"{run / 'episodes'} holds what an interrupted `anysim render` has left of 1 film "
        "(.env_0000_episode_0000.film): the same command removes it and goes on, or remove the directory",
        f"{run / 'episodes'} holds what is no trajectory: copy of one; remove it",
    ]
    said = CliRunner().invoke(app, ["verify", str(run)])
    assert said.exit_code == 0
    assert said.output.count("left over: ") == 3


@pytest.fixture
def rewritten(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if somebody had also made the MCAP file say what the manifest says."""
    monkeypatch.setattr(McapReader, "_contradictions", lambda self: [])


def test_an_episode_that_is_there_twice(run: Path) -> None:
    """Directories are named otherwise and hold the same, as after a merge of two runs by hand."""
    first = run / "episodes" / "env_0000_episode_0000"
    again = Path(shutil.copytree(first, run / "episodes" / "env_00000_episode_0000"))
    code, found = verified(run)
    assert code == 1
    assert found["runs"][0]["faults"] == [f"{first} and {again} both hold env 0, episode 0; remove one"]


def test_a_trajectory_of_another_run(run: Path) -> None:
    path = run / "episodes" / "env_0001_episode_0000"
    edit(path / "manifest.json", lambda data: data.update(notes=["a note"]))
    code, found = verified(path)
    assert code == 1
    assert found["damaged"] == {str(path): [f"{path} is of another run: notes is not that of {run / 'run.json'}"]}


@pytest.mark.usefixtures("rewritten")
def test_the_hash_of_another_world(run: Path) -> None:
    """It is told apart from a world that other versions build."""
    for file in [run / "run.json", *run.glob("episodes/*/manifest.json")]:
        edit(file, lambda data: data.update(world_hash="0" * 64))
    code, found = verified(run)
    [fault] = found["runs"][0]["faults"]
    assert code == 1
    assert "00000000" in fault
    assert fault.endswith("with the same versions: the spec or the hash was changed")
    for file in [run / "run.json", *run.glob("episodes/*/manifest.json")]:
        edit(file, lambda data: data["packages"].update({"anysim": "0.0.7"}))
    code, found = verified(run)
    [note] = found["runs"][0]["notes"]
    assert code == 0, found
    assert note.endswith("with other versions of anysim")


@pytest.mark.usefixtures("rewritten")
def test_a_replay_beside(run: Path) -> None:
    assert verified(run, "--replay")[0] == 0
    path = run / "episodes" / "env_0000_episode_0000"
    edit(path / "manifest.json", lambda data: data.update(episode_seed=data["episode_seed"] + 1))
    code, found = verified(run, "--replay")
    assert code == 1
    [fault] = found["damaged"][str(path)]
    assert "does not replay to the bit: it starts from another state, it differs from step 1 on" in fault

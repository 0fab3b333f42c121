"""`anysim verify`: which trajectories of a run are whole."""

import json
import shutil
from pathlib import Path

from typer.testing import CliRunner

from tests.plugins.inspect.commands import app


def test_a_changed_byte_is_named_and_the_other_trajectory_is_whole(recorded: Path, tmp_path: Path) -> None:
    whole = CliRunner().invoke(app, ["verify", str(recorded)])
    assert (whole.exit_code, whole.output) == (0, "2 of 2 trajectories are whole\n")
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

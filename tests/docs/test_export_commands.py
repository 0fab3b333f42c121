"""The commands of docs/export.md, in their order, in a folder of their own."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from anysim.testing.engines import require_drawing

PAGE = Path(__file__).parents[2] / "docs" / "export.md"


@pytest.mark.slow
def test_the_commands_of_the_page_work(tmp_path: Path) -> None:
    require_drawing("mujoco")
    block = re.search(r"^```\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    assert block is not None
    for line in block[1].splitlines():
        words = shlex.split(line)
        assert words[0] == "anysim"
        program = [sys.executable, "-c", "from anysim.cli.main import main; main()", *words[1:]]
        done = subprocess.run(program, capture_output=True, text=True, timeout=200, cwd=tmp_path, check=False)
        assert done.returncode == 0, done.stderr
        if words[1] == "tape":
            assert "3 of 3 episodes succeed; 3 come out as they were recorded" in done.stdout
    assert "lerobot" in done.stdout
    data = tmp_path / "data"
    assert (data / "lerobot" / "meta" / "info.json").exists()
    assert (data / "robomimic" / "demo.hdf5").exists()
    assert (data / "rlds" / "episodes" / "000002" / "steps.npz").exists()
    assert (data / "coco" / "coco.json").exists()
    assert (data / "foxglove" / "episodes" / "000002" / "episode.mcap").exists()
    assert (data / "shards" / "shard-000000.tar").exists()

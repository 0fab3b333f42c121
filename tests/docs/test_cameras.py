"""The commands of the page on cameras that fly."""

import re
import shlex
import sys
from pathlib import Path

import pytest

from anysim.cli.main import main
from anysim.record.reader import open_trajectory
from anysim.testing.engines import require_drawing

ROOT = Path(__file__).parents[2]
SAID = re.findall(r"^    (anysim .*)$", (ROOT / "docs" / "cameras.md").read_text(), re.MULTILINE)
EVENTS = {"camera/round/depth", "camera/near/segmentation", "annotation/near/camera", "language/narration"}
LOOKS = {"camera/eye/depth", "camera/eye/segmentation", "annotation/eye/camera", "language/narration"}


@pytest.mark.slow
@pytest.mark.usefixtures("command_line")
@pytest.mark.parametrize("line", SAID, ids=lambda line: shlex.split(line)[-1])
def test_a_command_of_the_page_records_what_it_says(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    require_drawing("mujoco")
    out = tmp_path / shlex.split(line)[-1]
    words = [str(ROOT / word) if word.startswith("docs/") else word for word in shlex.split(line)]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    kept = sorted((out / "episodes").iterdir())
    assert kept
    for path in kept:
        names = set(open_trajectory(path).names())
        assert names >= (LOOKS if "camera_look_at" in line else EVENTS)
        assert list(path.glob("*.mp4"))

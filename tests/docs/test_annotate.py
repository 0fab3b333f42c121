"""The commands of the page on annotations, in order, in one folder."""

import json
import re
import shlex
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from anysim.cli.main import main
from anysim.testing.engines import require_drawing
from anysim_annotation.files import read_records

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "annotate.md").read_text()
WORLDS = ROOT / "tests" / "plugins" / "annotation" / "worlds"
SAID = re.findall(r"^    (anysim .*)$", PAGE, re.MULTILINE)


@pytest.mark.slow
@pytest.mark.usefixtures("command_line")
def test_the_commands_of_the_page_make_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    require_drawing("mujoco")
    monkeypatch.chdir(tmp_path)
    for name in ("desk.yaml", "job.yaml"):
        shutil.copy(WORLDS / name, tmp_path)
    assert len(SAID) == 4
    for line in SAID:
        monkeypatch.setattr(sys, "argv", shlex.split(line))
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code == 0, line
    for name in ("env_0000_episode_0000", "env_0000_episode_0001"):
        beside = tmp_path / "runs" / "a" / "episodes" / f"{name}.annotations"
        boxes = read_records(beside / "front.boxes_2d.jsonl")
        assert {box["name"] for box in boxes} >= {"panda", "table"}
        out = tmp_path / "labels" / "a" / name
        sheet = json.loads((out / "annotations.json").read_text())
        assert sheet["cameras"]["front"]["width"] == 160
        with np.load(out / "front.normals.npz") as archive:
            assert archive[f"{sheet['steps'][1]:06d}"].shape == (120, 160, 3)
    coco = json.loads((tmp_path / "stills" / "desk" / "coco.json").read_text())
    assert len(coco["images"]) == 12
    assert [kind["name"] for kind in coco["categories"]] == ["block", "toy"]
    assert len(list((tmp_path / "stills" / "desk" / "kitti" / "label_2").iterdir())) == 12

"""The commands of the page on annotations, in order, in one folder."""

import json
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

from anysim import hooks
from anysim.cli.main import app, main
from anysim.testing.engines import require_drawing
from anysim_annotation.files import read_records

PAGE = (Path(__file__).parents[2] / "docs" / "annotate.md").read_text()
SAID = [
    line for block in re.findall(r"^```sh\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL) for line in block.splitlines()
]


def test_the_commands_of_the_page_make_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    require_drawing("mujoco")
    if not any(command.name == "render" for command in app.registered_commands):
        hooks.add_commands(app)
    monkeypatch.chdir(tmp_path)
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

"""`anysim bank`: banks of assets and tasks, what is there already, anchors, and inputs that are wrong."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from anysim.errors import AssetError, SpecError
from anysim.skills.bank import read_bank
from anysim_banks.cli import app

FEW = ("--raw", "40", "--keep", "6")
BOX = "{box: [0.04, 0.06, 0.1]}"


def anysim(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def built(*arguments: str) -> list[dict[str, Any]]:
    result = anysim("build", *arguments, *FEW, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)["banks"]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_bank_is_built_completed_and_shown() -> None:
    [row] = built(BOX)
    path = Path(str(row["file"]))
    bank = read_bank(path)
    assert (bank.asset, bank.affordance, len(bank)) == ("object", "body", 6)
    [again] = built(BOX)
    assert (again["version"], again["raw_per_cpu_second"]) == (row["version"], 0.0), "it was there already"
    [more] = built(BOX, "-e", "mujoco,pybullet")
    assert [name.split(" ")[0] for name in more["passed"]] == ["mujoco", "pybullet"]
    assert more["raw_per_cpu_second"] == 0.0
    [other] = built(BOX, "--seed", "7")
    assert other["version"] != row["version"]
    shown = anysim("show", str(path), "-k", "2")
    assert shown.exit_code == 0
    assert "6 candidates; held: 6 on mujoco" in shown.stdout


def test_a_task_has_a_bank_for_what_can_be_grasped() -> None:
    rows = built("pick_cube")
    assert [row["affordance"] for row in rows] == ["cube.body"]


def test_anchors_become_banks_by_trial(tmp_path: Path) -> None:
    anchor = {"name": "top", "point": [0, 0, 0.035], "radius": 0.015, "approach": [[0, 0, -1]], "prior": 0.5}
    path = tmp_path / "anchors.json"
    path.write_text(json.dumps({"format": "anysim-anchors-1", "source": "a person", "anchors": [anchor]}))
    result = anysim("build", BOX, "--affordances", str(path), "--raw", "400", "--keep", "6", "--json")
    assert result.exit_code == 0, result.output
    [row] = json.loads(result.stdout)["banks"]
    bank = read_bank(Path(str(row["file"])))
    assert (row["anchors"], row["prior"], bank.affordance) == ("a person", 0.5, "top")
    assert (bank.approach[:, 2] < -0.9).all()
    assert (((bank.pose[:, :3] - [0, 0, 0.035]) ** 2).sum(axis=1) <= 0.015**2 + 1e-9).all()


FAULTY = """{
  "format": "anysim-anchors-1",
  "anchors": [
    {"name": "a"},
    %s
  ]
}"""


@pytest.mark.parametrize(
    ("anchor", "message"),
    [
        ('{"name": "b"', r"anchors\.json:\d+:\d+: "),
        ('{"name": "b", "prior": 2}', r"anchors\.json:5:\d+: anchors\.1\.prior"),
        ('{"name": "b", "points": [0, 0, 0]}', r"anchors\.json:5:\d+: anchors\.1\.points"),
        ('{"name": "b", "pieces": ["lid"]}', r"anchors\.json:5:\d+: anchors\.1: the anchor 'b'.*no geom 'lid'"),
        ('{"name": "b", "link": "lid"}', r"anchors\.json:5:\d+: anchors\.1: the anchor 'b'.*no link"),
        ('{"name": "b", "kind": "button"}', r"anchors\.json:5:\d+: .*fingers do not close on"),
    ],
)
def test_wrong_anchors_are_refused_with_their_line(tmp_path: Path, anchor: str, message: str) -> None:
    path = tmp_path / "anchors.json"
    path.write_text(FAULTY % anchor)
    result = anysim("build", BOX, "--affordances", str(path))
    assert result.exit_code != 0
    with pytest.raises(SpecError, match=message):
        raise result.exception or AssertionError("no error")


def test_anchors_are_not_candidates_until_they_were_tried(tmp_path: Path) -> None:
    path = tmp_path / "anchors.json"
    path.write_text(FAULTY % '{"name": "beside", "point": [0.5, 0, 0]}')
    with pytest.raises(AssetError, match="format 'anysim-anchors-1', not 'anysim-bank-1'"):
        read_bank(path)
    rows = json.loads(anysim("build", BOX, "--affordances", str(path), *FEW, "--json").stdout)["banks"]
    assert [row["affordance"] for row in rows] == ["object.a", "object.beside"]
    assert "no grasp of object beside was held" in rows[1]["failed"], "nothing is there"
    assert [Path(row["file"]).exists() for row in rows if "file" in row] == [True]


def test_what_cannot_be_grasped_says_why() -> None:
    result = anysim("build", "{box: [0.3, 0.3, 0.3]}", "--raw", "10")
    assert result.exit_code != 0
    assert "narrower than" in str(result.exception)
    result = anysim("build", BOX, "--gripper", "cabinet")
    assert "no parallel gripper" in str(result.exception)
    result = anysim("build", BOX, "--gripper", "parallel_gripper:stroke=wide")
    assert "stroke=wide" in str(result.exception)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (("peg_in_hole", "--object", "block", "--robot", "franka_panda"), "block.mouth is a hole: what franka_panda"),
        (
            ("peg_in_hole", "--object", "block", "-a", "mouth", "--robot", "mobile_panda"),
            "--robot is for banks of grasps alone",
        ),
        (("nut_on_peg", "--object", "nut", "-a", "mouth"), "nothing free in .* has a tip that goes into nut.mouth"),
        (("nut_on_peg", "--object", "post"), r"'post' has no affordance that fingers close on \(it has: tip\)"),
        (("pick_cube", "--object", "cub"), "there is no entity 'cub'; did you mean 'cube'"),
    ],
)
def test_insertions_that_no_bank_is_made_of_are_refused(asked: tuple[str, ...], words: str) -> None:
    result = anysim("build", *asked, *FEW)
    assert result.exit_code != 0
    assert re.search(words, str(result.exception)), result.exception


def test_what_a_robot_reaches_of_a_task_with_holes_is_its_grasps() -> None:
    rows = built("peg_in_hole", "--robot", "franka_panda")
    assert [row["affordance"] for row in rows] == ["peg.body"]


def test_a_nut_has_grasps() -> None:
    assert [row["affordance"] for row in built("nut_on_peg")] == ["nut.body"]


def test_things_of_one_name_have_files_of_their_own() -> None:
    """Two boxes are both called `object`; neither bank takes the other's place, and each is found again."""
    [one], [other] = built(BOX), built("{box: [0.03, 0.06, 0.1]}")
    assert one["file"] != other["file"]
    assert read_bank(Path(str(one["file"]))).asset_hash != read_bank(Path(str(other["file"]))).asset_hash
    assert [built(BOX)[0]["raw_per_cpu_second"], built("{box: [0.03, 0.06, 0.1]}")[0]["raw_per_cpu_second"]] == [0, 0]

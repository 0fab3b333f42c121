"""`anysim compare` and `anysim audit` of several engines, as a user types them."""

import json
from pathlib import Path

import pytest

from tests.cli.test_cli import anysim

BLOCK = """
world:
  objects:
    block: {source: {box: [0.1, 0.1, 0.1]}, mass: 1.0}
"""


def test_a_comparison_is_written_and_told(tmp_path: Path) -> None:
    out = tmp_path / "report"
    result = anysim("compare", "pick_cube", "-e", "mujoco,pybullet", "--layers", "asset,kinematics", "--out", str(out))
    assert result.returncode == 0, result.stderr
    assert "kinematics\tagree (3)" in result.stdout
    assert str(out / "compare.html") in result.stdout
    data = json.loads((out / "compare.json").read_text())
    assert [layer["name"] for layer in data["layers"]] == ["asset", "kinematics"]
    assert list(data["engines"]) == ["mujoco", "pybullet"]
    assert "http" not in (out / "compare.html").read_text()


@pytest.mark.slow
def test_strict_answers_with_the_exit_code(tmp_path: Path) -> None:
    arguments = ("compare", "pick_cube", "-e", "mujoco,null", "--strict", "--json")
    fine = anysim(*arguments, "--layers", "kinematics", "--out", str(tmp_path / "a"))
    assert fine.returncode == 0, fine.stderr
    assert json.loads(fine.stdout)["differ"] == 0
    # Bullet's hulls have less volume than the World's; it declares so, and it is a difference all the same
    differs = anysim(
        "compare",
        "pick_cube",
        "-e",
        "pybullet",
        "--strict",
        "--json",
        "--layers",
        "asset",
        "--out",
        str(tmp_path / "b"),
    )
    assert differs.returncode == 1, differs.stderr
    layer = json.loads(differs.stdout)["layers"][0]
    assert [finding["subject"] for finding in layer["differ"]] == ["volume"]
    assert "within the declared" in layer["differ"][0]["explanation"]


@pytest.mark.slow
def test_what_does_not_apply_is_said_before_anything_is_measured(tmp_path: Path) -> None:
    world = tmp_path / "block.yaml"
    world.write_text(BLOCK)
    for layer, why in (
        ("task", "a world without a task"),
        ("kinematics", "nothing in this world has joints"),
        ("camera", "no cameras"),
        ("tast", "did you mean 'task'"),
    ):
        result = anysim("compare", str(world), "-e", "null", "--layers", layer, "--out", str(tmp_path / "out"))
        assert result.returncode == 2
        assert why in result.stderr
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("x")
    result = anysim("compare", str(world), "-e", "null", "--out", str(tmp_path / "out"))
    assert result.returncode == 2
    assert "is no comparison" in result.stderr
    assert "no engine named 'mujco'" in anysim("compare", str(world), "-e", "mujco").stderr


def test_help_teaches_the_layers() -> None:
    text = anysim("compare", "--help").stdout
    for word in ("asset", "kinematics", "actuation", "contact", "camera", "task", "--strict", "Examples"):
        assert word in text


def test_audit_of_all_engines_is_clean_within_what_they_declare() -> None:
    result = anysim("audit", "pick_cube", "--engine", "all", "--json")
    assert result.returncode == 0, result.stdout + result.stderr
    reports = {report["engine"]: report for report in json.loads(result.stdout)}
    assert {"mujoco", "null"} <= set(reports)
    assert all(report["different"] == 0 for report in reports.values())
    assert reports["mujoco"]["declared"] == 0


@pytest.mark.slow
def test_the_same_command_gives_the_same_bytes(tmp_path: Path) -> None:
    arguments = (
        "compare",
        "pick_cube",
        "-e",
        "mujoco,pybullet",
        "-k",
        "1",
        "--layers",
        "asset,kinematics,actuation,contact,task",
    )
    for name in ("a", "b"):
        result = anysim(*arguments, "--out", str(tmp_path / name))
        assert result.returncode == 0, result.stderr
    for file in ("compare.json", "compare.html"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes(), file

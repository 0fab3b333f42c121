"""A stranger's robot: its wheel beside ours in a fresh environment."""

import json

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("wheels")]  # built once, by one worker


def test_its_wheel_brings_a_robot_that_runs(environment, program, external_wheels, tmp_path) -> None:
    wheel = external_wheels["anysim-thirdarm"]
    python = environment("anysim-inspect", "anysim-mujoco", "anysim-robots", others=(wheel,), tools=("yourdfpy",))
    anysim = python.with_name("anysim")
    rows = {row["name"]: row for row in json.loads(program(anysim, "list", "robots", "--json", cwd=tmp_path).stdout)}
    assert (rows["third_arm"]["from"], rows["third_arm"]["available"]) == ("anysim-thirdarm", True)
    words = ("robot", "third_arm", "--check", "--hold", "0.5", "--random", "0.2", "--json")
    (found,) = json.loads(program(anysim, *words, cwd=tmp_path).stdout)["checks"]
    assert (found["engine"], found["status"]) == ("mujoco", "qualified")

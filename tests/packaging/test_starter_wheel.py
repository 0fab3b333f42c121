"""A stranger's skill, command and planner: the wheel beside ours in a fresh environment, and data collected with it."""

import json

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("wheels")]  # built once, by one worker
OURS = "anysim", "anysim-collect", "anysim-inspect", "anysim-mujoco", "anysim-mcap", "anysim-robots"


def test_its_wheel_brings_a_skill_a_command_and_a_planner_that_collect(
    environment, program, external_wheels, tmp_path
) -> None:
    wheel = external_wheels["anysim-starter"]
    python = environment(*OURS, others=(wheel,), tools=("pytest",))

    def anysim(*words: str):
        return json.loads(program(python.with_name("anysim"), *words, "--json", cwd=tmp_path).stdout)

    for kind, names in (("skills", {"starter_reach", "starter_plan_to"}), ("planners", {"starter_hop"})):
        assert names <= {row["name"] for row in anysim("list", kind) if row["from"] == "anysim-starter"}
    for task, phase in (("touch_shelf", "hold"), ("touch_twice", "2 starter_plan_to: follow")):
        words = ("-n", "4", "-k", "8", "--seed", "5", "-o", "record.cameras=[]", "--out", task)
        found = anysim("run", task, *words)
        assert found["successes"] == found["attempts"] == 8
        assert {episode["outcome"]["phase"] for episode in found["episodes"]} == {phase}
        again = anysim("replay", task)
        assert again["identical"] == again["replayed"] == 8
    suite = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "--pyargs", "anysim.testing.planners")
    out = program(python, *suite, "--planner", "starter_hop", cwd=tmp_path).stdout
    assert "anysim contract: planner starter_hop 1: 26 passed, 6 skipped (ik: 5, straight: 1)" in out

"""Drafts of catalogue entries: what is guessed, what is asked, and that each one builds."""

import re
from pathlib import Path

import numpy as np
import pytest

from anysim.api import compile_world, load
from anysim.assets.catalogue import load_robot
from anysim.assets.uri import example_robot_data
from anysim.errors import AssetError
from anysim.model.world import World
from anysim_robots.drafting.draft import draft
from anysim_robots.drafting.gains import BANDWIDTH
from anysim_robots.qualify.stage import stage

ROOT = Path(__file__).parents[3]
ARM = ROOT / "tests" / "external" / "anysim-thirdarm" / "anysim_thirdarm" / "third_arm.urdf"

GUESSES = {  # file: category, legs, wheels, arm, eef, tool
    "panda_description/urdf/panda.urdf": ("arm", 0, 0, 7, 1, "panda_hand_tcp"),
    "go1_description/urdf/go1.urdf": ("quadruped", 4, 0, 0, 0, None),
    "g1_description/urdf/g1_29dof_rev_1_0.urdf": ("humanoid", 2, 0, 17, 0, "right_rubber_hand"),
    "allegro_hand_description/urdf/allegro_right_hand.urdf": ("hand", 0, 0, 0, 16, "palm_link"),
}


def built(made, folder: Path) -> World:
    target = folder / f"{made.name}.yaml"
    target.write_text(made.text(folder))
    return compile_world(load(stage(load_robot(str(target)))))


@pytest.mark.parametrize("file", GUESSES)
def test_known_robots_are_recognised_and_their_drafts_build(file: str, tmp_path: Path) -> None:
    made = draft(example_robot_data() / file)
    g = made.guess
    assert (g.category, len(g.legs), len(g.wheels), len(g.arm), len(g.eef), g.tool) == GUESSES[file]
    world = built(made, tmp_path)
    driven = sum(joint.mimic is None for joint in world.joints)
    assert (
        len(world.actuators) == driven == len(made.model.joints) - sum(j.mimic is not None for j in made.model.joints)
    )
    assert all(0 < a.effort_limit < np.inf for a in world.actuators)
    if g.floating:
        assert not load_robot(str(tmp_path / f"{made.name}.yaml")).spec.gravity_compensation
        assert 0.2 < g.base_height < 1.2


def test_gains_are_critically_damped_at_the_stated_bandwidth() -> None:
    made = draft(ARM)
    omega = 2 * np.pi * BANDWIDTH
    for name in ("turn", "shoulder", "elbow"):
        kp, kd, armature = made.gains[name]
        assert kd == pytest.approx(2 * kp / omega, rel=0.06)  # two digits
        assert armature == pytest.approx(kp / omega**2 / 11, rel=0.06)  # a tenth of the link's, of eleven tenths


def test_what_cannot_be_inferred_is_a_comment_of_the_file(tmp_path: Path) -> None:
    made = draft(ARM, "My Arm 2")
    text = made.text(tmp_path)
    assert made.name == "my_arm_2"
    assert re.search(r"^# TODO license: the SPDX", text, re.MULTILINE)
    assert "finger_mirror follow other joints and are in no channel" in text
    assert all(f"# TODO {words}" in text for words in made.open)
    spec = load_robot(_written(tmp_path / "x.yaml", text)).spec
    assert (spec.channels["eef"].opened, spec.channels["eef"].closed) == ((0.03,), (0.0,))
    assert spec.base == "fixed"


def _written(path: Path, text: str) -> str:
    path.write_text(text)
    return str(path)


def test_a_model_beside_the_draft_is_named_relative_to_it() -> None:
    assert "\nsource: third_arm.urdf\n" in draft(ARM).text(ARM.parent)


def test_a_floating_mjcf_with_wheels_is_a_base(tmp_path: Path) -> None:
    wheel = (
        '<body name="{0}" pos="{1} 0.2 0"><joint name="{0}_joint" axis="0 1 0"/>'
        '<geom type="cylinder" size="0.1 0.02" euler="90 0 0" mass="1"/></body>'
    )
    (tmp_path / "cart.xml").write_text(
        '<mujoco><worldbody><body name="cart" pos="0 0 0.1"><freejoint/>'
        '<geom type="box" size="0.3 0.15 0.05" mass="5"/>'
        + wheel.format("left_wheel", 0.2)
        + wheel.format("right_wheel", -0.2)
        + "</body></worldbody></mujoco>"
    )
    made = draft(tmp_path / "cart.xml")
    assert made.guess.category == "base"
    assert made.guess.wheels == ("left_wheel_joint", "right_wheel_joint")
    world = built(made, tmp_path)
    assert {str(actuator.mode) for actuator in world.actuators} == {"velocity"}
    assert made.guess.base_height == pytest.approx(0.1, abs=2e-3)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="takes a URDF or MJCF file"):
        draft(tmp_path / "none.urdf")


def test_one_of_several_bodies_has_a_draft_of_its_own(tmp_path: Path) -> None:
    bodies = "".join(
        f'<body name="{side}"><body name="{side}_arm"><joint name="{side}_turn" axis="0 0 1"/>'
        '<geom type="box" size="0.1 0.1 0.1"/></body></body>'
        for side in ("left", "right")
    )
    (tmp_path / "pair.xml").write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    made = draft(tmp_path / "pair.xml#right")
    assert made.name == "right"
    assert 'source: "pair.xml#right"' in made.text(tmp_path)
    assert [joint.name for joint in built(made, tmp_path).joints] == ["robot.right_turn"]

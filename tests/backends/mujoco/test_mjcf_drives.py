"""Drives and armature that an MJCF file declares, where a catalogue entry leaves them open."""

from pathlib import Path

import pytest

from anysim.compile.world import compile_with_report, compile_world
from anysim.errors import SpecError
from anysim.model.world import Actuator, World
from anysim_schemas.run import WorldSpec

FILE = """<mujoco><worldbody><body name="base"><geom size="0.1"/>
  <body name="a"><joint name="turn" armature="0.3" range="-90 90"/><geom size="0.1"/>
    <body name="b" pos="0 0 0.3"><joint name="grip" type="slide" range="0 0.1" actuatorfrcrange="-35 35"/>
      <geom size="0.05"/></body></body></body></worldbody>
  <actuator><position joint="turn" kp="300" kv="30" forcerange="-20 20"/>
    <velocity joint="grip" kv="40" forcerange="-50 50"/></actuator></mujoco>"""

ENTRY = """name: made
description: two joints with drives of their own
source: made.xml
license: MIT
license_source: here
category: arm
base: fixed
channels:
  arm: {{joints: [turn]{arm}}}
  eef: {{joints: [grip]{eef}}}
"""


def world(folder: Path, arm: str = "", eef: str = ", mode: velocity") -> World:
    (folder / "made.xml").write_text(FILE)
    (folder / "made.yaml").write_text(ENTRY.format(arm=arm, eef=eef))
    return compile_world(WorldSpec.model_validate({"robots": {"r": {"robot": str(folder / "made.yaml")}}}))


def drive(made: World, index: int) -> tuple[float, float, float]:
    one: Actuator = made.actuators[index]
    return one.kp, one.kd, one.effort_limit


def test_an_entry_without_gains_has_the_files(tmp_path: Path) -> None:
    """Of a joint that states a limit, too, the smaller of both."""
    made = world(tmp_path)
    assert drive(made, 0) == (300, 30, 20)
    assert drive(made, 1) == (0, 40, 35)
    assert [joint.armature for joint in made.joints] == [0.3, 0.0]


@pytest.mark.parametrize(
    ("gains", "limit", "armature"),
    [
        ("kp: 7, kd: 1", 20, 0.3),
        ("kp: 7, kd: 1, armature: 0.01", 20, 0.01),
        ("kp: 7, kd: 1, armature: 0", 20, 0.0),
        ("kp: 7, kd: 1, effort_limit: 60", 60, 0.3),
    ],
)
def test_what_an_entry_says_wins_and_only_that(tmp_path: Path, gains: str, limit: float, armature: float) -> None:
    made = world(tmp_path, arm=f", gains: {{{gains}}}")
    assert drive(made, 0) == (7, 1, limit)
    assert made.joints[0].armature == armature


def test_a_drive_of_another_mode_is_not_taken(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"no gains for the joint 'grip'.*its source drives it by velocity"):
        world(tmp_path, eef="")


def test_drives_of_an_object_are_said_to_be_left_out(tmp_path: Path) -> None:
    (tmp_path / "made.xml").write_text(FILE)
    spec = WorldSpec.model_validate({"objects": {"it": {"source": "made.xml", "fixed": True}}})
    report = compile_with_report(spec, base=tmp_path).report["it"]
    assert "actuators: 2 drives of its file are left out: joints of an object are not driven (dropped)" in map(
        str, report
    )

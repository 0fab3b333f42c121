"""One of several bodies of an MJCF file, named by the URI's fragment: alone, and as the file has it."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from anysim.assets.load import import_asset, model_file
from anysim.compile.builder import WorldBuilder
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import BodyKind, ControlMode, EntityKind, World
from anysim_robots.qualify.run import Durations, qualify

CELL = """
<mujoco model="cell">
  <compiler angle="radian"/>
  <worldbody>
    <camera name="top" pos="0 0 2" mode="targetbody" target="cube"/>
    <light pos="1 0 2" mode="targetbody" target="cube"/>
    <body name="table" pos="0.5 0 0"><geom type="box" size="0.3 0.6 0.02"/><site name="mark"/></body>
    <body name="left" pos="0 0.3 0.1" euler="0 0 0.4">
      <geom type="box" size="0.05 0.05 0.05" mass="2"/>
      <body name="left_arm" pos="0 0 0.05">
        <joint name="left_turn" axis="0 0 1" range="-2 2" ref="0.1"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 0.3" mass="0.5"/>
        <site name="left_tip" pos="0 0 0.3"/>
        <body name="left_finger" pos="0 0 0.3">
          <joint name="left_slide" type="slide" axis="1 0 0" range="0 0.04"/>
          <geom type="box" size="0.01 0.01 0.03" mass="0.1"/>
        </body>
      </body>
    </body>
    <body name="right" pos="0 -0.3 0.1" euler="0 0 -0.4">
      <geom type="box" size="0.05 0.05 0.05" mass="2"/>
      <body name="right_arm" pos="0 0 0.05">
        <joint name="right_turn" axis="0 1 0" range="-1 1"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 0.3" mass="0.7"/>
      </body>
    </body>
    <body name="cube" pos="0.5 0 0.1"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.05"/></body>
  </worldbody>
  <equality>
    <weld body1="cube" body2="left_finger"/>
    <joint joint1="left_turn" joint2="right_turn"/>
  </equality>
  <tendon><spatial name="rope"><site site="mark"/><site site="left_tip"/></spatial></tendon>
  <actuator>
    <position name="l" joint="left_turn" kp="50" kv="5"/>
    <position name="r" joint="right_turn" kp="70" kv="7"/>
    <motor name="pull" tendon="rope"/>
  </actuator>
  <sensor><framepos objtype="body" objname="cube" reftype="body" refname="left_finger"/></sensor>
  <keyframe><key name="home" qpos="0.3 0.02 0.7 0.5 0 0.1 1 0 0 0"/></keyframe>
</mujoco>
"""

ENTRY = """
name: pair
description: two of the four bodies of a file
source: cell.xml#left
license: Apache-2.0
license_source: here
category: dual_arm
parts:
  - {source: cell.xml#right, link: left, position: [0.1, -0.6, 0.0], license: Apache-2.0, license_source: here}
channels:
  arm:
    joints: [left_turn, right_turn]
    groups: {left: [left_turn], right: [right_turn]}
    gains: {kp: 100, kd: 10, effort_limit: 20, armature: 0.02}
  eef:
    joints: [left_slide]
    gains: {kp: 100, kd: 20, effort_limit: 5, armature: 0.1}
"""


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    path = tmp_path / "cell.xml"
    path.write_text(CELL, encoding="utf-8")
    return path


def test_it_comes_alone(cell: Path) -> None:
    left = import_asset(f"{cell}#left")
    assert [body.name for body in left.bodies] == ["left", "left_arm", "left_finger"]
    assert [joint.name for joint in left.joints] == ["left_turn", "left_slide"]
    assert [(hint.joint, hint.mode, hint.kp) for hint in left.actuator_hints] == [(0, ControlMode.POSITION, 50.0)]
    assert [joint.initial for joint in left.joints] == [0.3, 0.02]
    assert {site.name for site in left.sites} == {"left_tip"}
    assert left.excluded_pairs == frozenset()
    right = import_asset("cell.xml#right", base=cell.parent)
    assert [joint.initial for joint in right.joints] == [0.7], "the home of the file's keyframe moves along"
    cube = import_asset(f"file:{cell}#cube")
    assert [body.kind for body in cube.bodies] == [BodyKind.FREE]


def test_its_links_are_where_the_whole_file_has_them(cell: Path) -> None:
    """Against MuJoCo with all four bodies, seen from the one that was taken."""
    whole = mujoco.MjModel.from_xml_path(str(cell))
    data = mujoco.MjData(whole)
    for name, positions in {"left": [0.7, 0.03], "right": [-0.4]}.items():
        model = import_asset(f"{cell}#{name}")
        builder = WorldBuilder(World("one"))
        builder.add("it", EntityKind.ROBOT, model, root=BodyKind.STATIC)
        world = builder.build()
        q = np.array([positions])
        frames = forward_kinematics(world, np.array([[P.pose((0, 0, 0), (0, 0, 0, 1))] * len(world.bodies)]), q)
        for joint, value in zip(model.joints, positions, strict=True):
            data.qpos[whole.joint(joint.name).qposadr] = value
        mujoco.mj_kinematics(whole, data)
        root = P.inverse(np.concatenate([data.body(name).xpos, np.roll(data.body(name).xquat, -1)]))
        for body, frame in zip(model.bodies, frames[0], strict=True):
            raw = data.body(body.name)
            expected = P.compose(root, np.concatenate([raw.xpos, np.roll(raw.xquat, -1)]))
            np.testing.assert_allclose(frame[:3], expected[:3], atol=1e-12, err_msg=body.name)
            assert abs(frame[3:] @ expected[3:]) == pytest.approx(1.0, abs=1e-12)


def test_what_tied_it_to_others_is_said(cell: Path) -> None:
    others = {
        "cameras: are left out: those of a world are its own (1: top) (dropped)",
        "lights: are left out: those of a world are its own (1: without a name) (dropped)",
    }
    words = {str(note) for note in import_asset(f"{cell}#left").report}
    assert words == others | {
        "left: equalities between it and other bodies of the file are left out (2) (dropped)",
        "left: tendons between it and other bodies of the file are left out (1) (dropped)",
    }
    assert {str(note) for note in import_asset(f"{cell}#table").report} == others | {
        "table: tendons between it and other bodies of the file are left out (1) (dropped)"
    }


@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("cell.xml#lefd", r"its world has no body 'lefd'; did you mean 'left'\? \(bodies: table, left, right, cube\)"),
        ("cell.xml#left_arm", r"no body 'left_arm'; did you mean 'left'\? \(bodies: table, left, right, cube\)"),
        ("plain.xml", r"this one has table, left, right, cube; name the one that is meant: plain.xml#table"),
        ("box.urdf#base", "a URDF is one tree; '#' chooses among the bodies of an MJCF file's world"),
        ("cell.xml#", "does not exist: no file"),
    ],
)
def test_what_cannot_be_meant_says_what_there_is(cell: Path, uri: str, words: str) -> None:
    (cell.parent / "plain.xml").write_text(CELL[: CELL.index("<equality>")] + "</mujoco>", encoding="utf-8")
    (cell.parent / "box.urdf").write_text('<robot name="box"><link name="base"/></robot>', encoding="utf-8")
    with pytest.raises(AssetError, match=words):
        import_asset(uri, base=cell.parent)


def test_a_hash_in_a_path_is_part_of_it(cell: Path) -> None:
    folder = cell.parent / "c#"
    folder.mkdir()
    (folder / "cell.xml").write_text(CELL, encoding="utf-8")
    assert model_file(f"{folder}/cell.xml").body == ""
    assert model_file(f"{folder}/cell.xml#right") == (folder / "cell.xml", folder, "mjcf", "right")


def test_two_bodies_of_a_file_are_one_robot(cell: Path) -> None:
    """The first is its source, the second a part; other readers of both files agree about where the links are."""
    entry = cell.parent / "pair.yaml"
    entry.write_text(ENTRY, encoding="utf-8")
    found = qualify(str(entry), "mujoco", Durations(0.2, 0.1, 0.1))
    assert found.status == "qualified", [check.told for check in found.failed]
    assert found.oracle == "raw MuJoCo, composed"
    assert found.facts is not None
    assert (found.facts.joints, found.facts.mass) == (3, pytest.approx(5.3))

"""Joints of several axes, as chains of joints of one axis: where they put a link, and what is said of it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from anysim.assets.model import ImportedModel
from anysim.compile.builder import WorldBuilder
from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import BodyKind, EntityKind, JointType, World
from anysim_urdf.sdf import import_sdf

Load = Callable[..., ImportedModel]
Text = Callable[[float], str]
ORIGIN = P.pose((0.1, 0.2, 0.3), P.from_roll_pitch_yaw(np.array([0.4, 0.5, 0.6])))
VALUES = (0.3, -0.2, 0.7, 0.5, -0.4, 0.9)


def placed(model: ImportedModel, link: str, values: Sequence[float]) -> Array:
    """Where a link is (7,) with the joints at these positions."""
    joints = tuple(replace(joint, initial=value) for joint, value in zip(model.joints, values, strict=True))
    builder = WorldBuilder(World(name="w"))
    builder.add("robot", EntityKind.ROBOT, replace(model, joints=joints), root=BodyKind.STATIC)
    world = builder.build()
    return world.initial_body_pose[[body.name for body in world.bodies].index(f"robot.{link}")]


@pytest.fixture
def jointed(urdf: Load, inertial: Text) -> Callable[..., ImportedModel]:
    """Two links and a joint of a type between them."""

    def read(kind: str, axis: str = "0 0 1", base: str = "1", more: str = "") -> ImportedModel:
        first = inertial(float(base)) if base else ""
        return urdf(
            f'<link name="a">{first}</link><link name="b">{inertial(2)}</link>'
            f'<joint name="j" type="{kind}"><origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/><parent link="a"/>'
            f'<child link="b"/><axis xyz="{axis}"/>{more}</joint>'
        )

    return read


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 0, 0), (0, 1, 0), (1, 2, 3)])
def test_a_planar_joint_moves_across_its_axis_and_turns_about_it(jointed: Load, axis: tuple[int, ...]) -> None:
    model = jointed("planar", " ".join(map(str, axis)))
    assert [joint.name for joint in model.joints] == ["j.x", "j.y", "j.yaw"]
    x, y, yaw = VALUES[:3]
    normal = np.array(axis) / np.linalg.norm(axis)
    first, second = (np.array(joint.axis) for joint in model.joints[:2])
    assert np.allclose(np.cross(first, second), normal)
    step = P.pose(x * first + y * second, P.from_axis_angle(normal, np.array(yaw)))
    assert placed(model, "b", (x, y, yaw)) == pytest.approx(P.compose(ORIGIN, step), abs=1e-12)
    if axis == (0, 0, 1):
        assert np.allclose([first, second], np.eye(3)[:2])
    notes = [str(note) for note in model.report]
    assert (
        "joint 'j' (arm.urdf:3): is planar, and becomes a chain of joints of one axis: j.x, j.y, j.yaw (info)" in notes
    )
    assert model.bodies[-1].inertial.mass == 2.0


@pytest.mark.parametrize("kind", ["spherical", "floating"])
def test_turns_follow_each_other_about_x_y_and_z(jointed: Load, kind: str) -> None:
    model = jointed(kind, more='<limit lower="-1" upper="1"/>')
    names = [joint.name.removeprefix("j.") for joint in model.joints]
    assert names == (["x", "y", "z"] if kind == "floating" else []) + ["roll", "pitch", "yaw"]
    values = VALUES[-len(names) :]
    turn = np.array([0.0, 0.0, 0.0, 1.0])
    for axis, angle in zip(np.eye(3), values[-3:], strict=True):
        turn = P.multiply(turn, P.from_axis_angle(axis, np.array(angle)))
    step = P.pose(values[:3] if kind == "floating" else (0.0, 0.0, 0.0), turn)
    found, wanted = placed(model, "b", values), P.compose(ORIGIN, step)
    assert found[:3] == pytest.approx(wanted[:3], abs=1e-12)
    assert float(P.angle_between(found[3:], wanted[3:])) == pytest.approx(0.0, abs=1e-7)
    assert any("its limits are left out" in note.message for note in model.report)
    assert {joint.type for joint in model.joints[-3:]} == {JointType.REVOLUTE}


def test_an_empty_root_of_a_floating_joint_is_the_world(jointed: Load) -> None:
    model = jointed("floating", base="")
    assert (model.bodies[0].name, model.bodies[0].kind, model.joints) == ("b", BodyKind.FREE, ())
    assert any("is nothing but the world: the model floats" in note.message for note in model.report)


def test_a_ball_of_sdf_turns_about_its_place(tmp_path: Path) -> None:
    """The joint is 0.5 m above the link that it moves, which is turned over it."""
    mass = "<inertial><mass>1</mass></inertial>"
    (tmp_path / "ball.sdf").write_text(
        f'<sdf version="1.9"><model name="m"><link name="a">{mass}</link><link name="b"><pose>0 0 1 0 0 0</pose>{mass}'
        '</link><joint name="j" type="ball"><pose>0 0 0.5 0 0 0</pose><parent>a</parent><child>b</child></joint>'
        "</model></sdf>"
    )
    model = import_sdf(tmp_path / "ball.sdf", root=tmp_path)
    assert placed(model, "b", (np.pi, 0.0, 0.0))[:3] == pytest.approx((0.0, 0.0, 2.0), abs=1e-9)
    assert placed(model, "b", (0.0, np.pi / 2, 0.0))[:3] == pytest.approx((-0.5, 0.0, 1.5), abs=1e-9)

"""A model fixed to a link of another: masses, frames, order, names."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from anysim.assets.attach import attach
from anysim.assets.catalogue import CatalogueEntry
from anysim.assets.model import ActuatorHint, ImportedModel
from anysim.compile.builder import WorldBuilder
from anysim.compile.robot import import_robot
from anysim.errors import AssetError
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import BodyKind, ControlMode, EntityKind, Mesh, MeshShape, World
from anysim_schemas.robot_model import RobotModelSpec

ARM = """
<link name="stand"><inertial><mass value="5"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<link name="upper">{i}<collision><geometry><sphere radius="0.05"/></geometry></collision></link>
<link name="fore">{i}</link><link name="flange"/><link name="side">{i}</link>
<joint name="shoulder" type="revolute"><origin xyz="0 0 0.5" rpy="0.1 0.2 0.3"/><parent link="stand"/>
  <child link="upper"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="50" velocity="2"/></joint>
<joint name="elbow" type="revolute"><origin xyz="0.3 0 0" rpy="0 0.4 0"/><parent link="upper"/><child link="fore"/>
  <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="50" velocity="2"/></joint>
<joint name="weld" type="fixed"><origin xyz="0.2 0.01 0" rpy="0 1.5 0"/><parent link="fore"/><child link="flange"/></joint>
<joint name="swivel" type="revolute"><origin xyz="0 0.2 0"/><parent link="stand"/><child link="side"/><axis xyz="1 0 0"/>
  <limit lower="-2" upper="2" effort="50" velocity="2"/><mimic joint="shoulder" multiplier="0.5"/></joint>
"""  # noqa: E501
HAND = """
<link name="palm"><inertial><origin xyz="0 0 0.03"/><mass value="0.4"/>
  <inertia ixx="0.002" ixy="0.0001" ixz="0" iyy="0.003" iyz="0" izz="0.0025"/></inertial>
  <collision><origin xyz="0 0 0.02"/><geometry><box size="0.1 0.05 0.04"/></geometry></collision></link>
<link name="left">{i}</link><link name="right">{i}</link><link name="tip"/>
<joint name="open" type="prismatic"><origin xyz="0 0 0.05" rpy="0 0 0.2"/><parent link="palm"/><child link="left"/>
  <axis xyz="0 1 0"/><limit lower="0" upper="0.04" effort="20" velocity="1"/></joint>
<joint name="follow" type="prismatic"><origin xyz="0 0 0.05"/><parent link="palm"/><child link="right"/>
  <axis xyz="0 -1 0"/><limit lower="0" upper="0.04" effort="20" velocity="1"/><mimic joint="open"/></joint>
<joint name="end" type="fixed"><origin xyz="0 0 0.12"/><parent link="palm"/><child link="tip"/></joint>
"""
POSE = P.pose((0.01, -0.02, 0.03), P.from_roll_pitch_yaw(np.array([0.3, -0.5, 0.7])))


@pytest.fixture
def arm(urdf: Callable[..., ImportedModel], inertial: Callable[[float], str]) -> ImportedModel:
    return urdf(ARM.format(i=inertial(2.0)))


@pytest.fixture
def hand(urdf: Callable[..., ImportedModel], inertial: Callable[[float], str]) -> ImportedModel:
    return replace(urdf(HAND.format(i=inertial(0.1))), name="hand")


def world_of(model: ImportedModel) -> World:
    builder = WorldBuilder(World())
    builder.add("it", EntityKind.ROBOT, model, root=BodyKind.STATIC)
    return builder.build()


def frames(model: ImportedModel, joints: dict[str, float]) -> dict[str, np.ndarray]:
    """Poses (7,) of all links and sites in the root's frame, for joint positions by name."""
    world = world_of(model)
    names = [joint.name for joint in model.joints]
    q = np.array([[joints.get(name, 0.0) for name in names]])
    body = forward_kinematics(world, np.array([[0.0, 0, 0, 0, 0, 0, 1]] * len(world.bodies))[None], q)[0]
    poses = {b.name.removeprefix("it."): body[i] for i, b in enumerate(world.bodies)}
    for site in world.sites:
        poses[site.name.removeprefix("it.")] = P.compose(body[site.body], P.pose(site.position, site.quaternion))
    return poses


def same(a: np.ndarray, b: np.ndarray) -> bool:
    turn = min(np.abs(a[3:] - b[3:]).max(), np.abs(a[3:] + b[3:]).max())
    return bool(np.abs(a[:3] - b[:3]).max() < 1e-10 and turn < 1e-10)


def names(things: Sequence[object]) -> list[str]:
    return [thing.name for thing in things]  # type: ignore[attr-defined]


def test_bodies_stay_depth_first_and_joints_move_the_next_body(arm: ImportedModel, hand: ImportedModel) -> None:
    both = attach(arm, hand, "flange", POSE, "h_")
    assert names(both.bodies) == ["stand", "upper", "fore", "h_left", "h_right", "side"]
    assert names(both.joints) == ["shoulder", "elbow", "h_open", "h_follow", "swivel"]
    assert [joint.body for joint in both.joints] == [1, 2, 3, 4, 5]
    assert [body.parent for body in both.bodies] == [-1, 0, 1, 2, 2, 0]
    mimics = {joint.name: joint.mimic.joint for joint in both.joints if joint.mimic is not None}
    assert mimics == {"h_follow": 2, "swivel": 0}
    assert both.links["h_palm"] == both.links["h_tip"] == both.links["flange"] == 2
    assert both.links["side"] == 5


def test_frames_are_where_composing_by_hand_puts_them(arm: ImportedModel, hand: ImportedModel) -> None:
    q = {"shoulder": 0.7, "elbow": -0.4, "swivel": 0.35}
    fingers = {"open": 0.02, "follow": 0.02}
    both = frames(attach(arm, hand, "flange", POSE, "h_"), q | {f"h_{k}": v for k, v in fingers.items()})
    alone, part = frames(arm, q), frames(hand, fingers)
    assert all(same(both[name], pose) for name, pose in alone.items())
    root = P.compose(alone["flange"], POSE)
    for name in ("palm", "left", "right", "tip"):
        assert same(both[f"h_{name}"], P.compose(root, part[name])), name


def test_the_carrying_body_has_the_mass_of_both(arm: ImportedModel, hand: ImportedModel) -> None:
    """Against the mass integrals themselves: sums of m, m r and of the inertia about the body's origin."""
    both = attach(arm, hand, "flange", POSE)
    carrier = arm.links["flange"]
    site = next(s for s in arm.sites if s.name == "flange")
    frame = P.compose(P.pose(site.position, site.quaternion), POSE)
    turn = P.to_matrix(frame[3:])

    def about_origin(mass: float, com: np.ndarray, matrix: np.ndarray) -> np.ndarray:
        return matrix + mass * (com @ com * np.eye(3) - np.outer(com, com))

    own, root, found = arm.bodies[carrier].inertial, hand.bodies[0].inertial, both.bodies[carrier].inertial
    com = frame[:3] + turn @ np.array(root.com)
    assert found.mass == pytest.approx(own.mass + root.mass)
    assert np.allclose(found.mass * np.array(found.com), own.mass * np.array(own.com) + root.mass * com, atol=1e-12)
    expected = about_origin(own.mass, np.array(own.com), inertia.tensor(own))
    expected += about_origin(root.mass, com, turn @ inertia.tensor(root) @ turn.T)
    assert np.allclose(about_origin(found.mass, np.array(found.com), inertia.tensor(found)), expected, atol=1e-10)
    assert sum(b.inertial.mass for b in both.bodies) == pytest.approx(
        sum(b.inertial.mass for b in (*arm.bodies, *hand.bodies))
    )


def test_geoms_hints_and_pairs_come_along(arm: ImportedModel, hand: ImportedModel) -> None:
    hint = ActuatorHint(0, ControlMode.POSITION, 1.0, 2.0, 3.0)
    arm = replace(arm, actuator_hints=(hint._replace(joint=2),), excluded_pairs=frozenset({(1, 3)}))
    hand = replace(hand, actuator_hints=(hint,), excluded_pairs=frozenset({(1, 2)}))
    both = attach(arm, hand, "upper", POSE, "h_")
    assert names(both.bodies) == ["stand", "upper", "fore", "h_left", "h_right", "side"]
    assert [h.joint for h in both.actuator_hints] == [4, 2]
    assert both.excluded_pairs == {(1, 5), (3, 4)}
    assert [str(note) for note in both.report] == ["palm: passes through what 'upper' does (dropped)"]
    box = both.geoms[1]
    assert (box.body, both.geom_links) == (1, ("upper", "h_palm"))
    assert same(P.pose(box.position, box.quaternion), P.compose(POSE, P.pose((0, 0, 0.02), (0, 0, 0, 1))))
    assert attach(arm, hand, "side", POSE).excluded_pairs == {(1, 3), (4, 5)}


def test_two_meshes_of_one_name_are_kept_apart(arm: ImportedModel, hand: ImportedModel) -> None:
    corners, faces = np.eye(4, 3), np.array([[0, 1, 2], [0, 1, 3]], dtype=np.int32)
    first, second = (Mesh("hull", corners * s, faces, hash=f"{s}" * 16) for s in (1, 2))

    def shaped(model: ImportedModel, mesh: Mesh) -> ImportedModel:
        geoms = tuple(replace(g, shape=MeshShape("hull")) for g in model.geoms)
        return replace(model, geoms=geoms, meshes=(mesh,))

    both = attach(shaped(arm, first), shaped(hand, second), "flange", POSE)
    size = {mesh.name: mesh.vertices.max() for mesh in both.meshes}
    assert [size[g.shape.mesh] for g in both.geoms if isinstance(g.shape, MeshShape)] == [1.0, 2.0]
    assert len(attach(shaped(arm, first), shaped(hand, first), "flange", POSE).meshes) == 1


def test_what_does_not_fit_is_said(arm: ImportedModel, hand: ImportedModel) -> None:
    with pytest.raises(AssetError) as caught:
        attach(arm, hand, "flangge", POSE)
    assert str(caught.value) == (
        "'arm' has no link 'flangge' to carry 'hand'; did you mean 'flange'? (links: stand, upper, fore, flange, side)"
    )
    both = attach(arm, hand, "flange", POSE)
    with pytest.raises(AssetError) as caught:
        attach(both, hand, "side", POSE)
    assert str(caught.value) == (
        "'arm' has the links left, palm, right, tip already, which 'hand' brings too; give the part a `prefix`, as "
        "'tool_'"
    )
    assert len(attach(both, hand, "side", POSE, "second_").joints) == 7


def test_an_entry_says_which_part_is_wrong(tmp_path: Path, inertial: Callable[[float], str]) -> None:
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm">{ARM.format(i=inertial(2.0))}</robot>')
    (tmp_path / "hand.urdf").write_text(f'<robot name="hand">{HAND.format(i=inertial(0.1))}</robot>')
    part = {"source": "hand.urdf", "link": "flange", "license": "BSD-3-Clause", "license_source": "here"}
    content = {
        "name": "arm", "description": "-", "source": "arm.urdf", "license": "MIT", "license_source": "here",
        "category": "arm", "channels": {}, "parts": [part],
    }  # fmt: skip

    def entry(**changes: object) -> CatalogueEntry:
        spec = RobotModelSpec.model_validate(content | {"parts": [part | changes]})
        return CatalogueEntry(spec, tmp_path / "arm.yaml")

    assert len(import_robot(entry()).joints) == 5
    with pytest.raises(AssetError, match=r"^parts\.0 of robot 'arm': 'arm' has no link 'wrist' to carry 'hand'"):
        import_robot(entry(link="wrist"))
    with pytest.raises(AssetError, match=r"the source of parts\.0 of robot 'arm' is not valid: .*strokes"):
        import_robot(entry(source="procedural:valve", params={"strokes": 1}))

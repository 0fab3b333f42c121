"""The catalogue's Panda: kinematics and masses against the source, and the conventions of its channels and tool."""

import logging

import numpy as np
import pytest
import yourdfpy

from anysim.assets.catalogue import load_robot
from anysim.assets.uri import locate
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.frames import find_frame
from anysim.model.world import BodyKind, Box, ControlMode, MeshShape, World


@pytest.fixture(scope="module")
def source() -> yourdfpy.URDF:
    logging.getLogger("yourdfpy").setLevel(logging.ERROR)
    file = locate(load_robot("franka_panda").spec.source)
    return yourdfpy.URDF.load(str(file.path), load_meshes=False)


def roots(world: World, count: int) -> np.ndarray:
    return np.tile([[*b.position, *b.quaternion] for b in world.bodies], (count, 1, 1))


def test_forward_kinematics_of_every_link_equals_the_source(panda: World, source: yourdfpy.URDF) -> None:
    rng = np.random.default_rng(0)
    low, high = np.array([[j.lower, j.upper] for j in panda.joints]).T
    joints = rng.uniform(low, high, size=(20, len(low)))
    joints[:, 8] = joints[:, 7]  # the second finger follows
    poses = forward_kinematics(panda, roots(panda, 20), joints)
    names = [j.name.removeprefix("panda.") for j in panda.joints]
    for row in range(20):
        source.update_cfg({name: joints[row, i] for i, name in enumerate(names) if i != 8})
        for link in source.link_map:
            frame = find_frame(panda, f"panda.{link}")
            found = P.compose(poses[row, frame.body], P.pose(frame.position, frame.quaternion))
            expected = source.get_transform(link, "panda_link0")
            np.testing.assert_allclose(found[:3], expected[:3, 3], atol=1e-9, rtol=0, err_msg=link)
            np.testing.assert_allclose(P.to_matrix(found[3:]), expected[:3, :3], atol=1e-9, rtol=0, err_msg=link)


def test_masses_equal_the_source(panda: World, source: yourdfpy.URDF) -> None:
    mass = {name: (link.inertial.mass if link.inertial else 0.0) for name, link in source.link_map.items()}
    assert sum(b.inertial.mass for b in panda.bodies) == pytest.approx(sum(mass.values()), abs=1e-12)
    found = {b.name: b.inertial for b in panda.bodies}
    for i in range(7):
        assert found[f"panda.panda_link{i}"].mass == mass[f"panda_link{i}"]
    assert found["panda.panda_link7"].mass == pytest.approx(mass["panda_link7"] + mass["panda_hand"], abs=1e-12)
    own = source.link_map["panda_link3"].inertial
    np.testing.assert_allclose(found["panda.panda_link3"].com, own.origin[:3, 3], atol=1e-12)
    xx, yy, zz, xy, xz, yz = found["panda.panda_link3"].inertia
    np.testing.assert_allclose([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], own.inertia, atol=1e-12)


def test_lumped_hand_against_point_masses(panda: World, source: yourdfpy.URDF) -> None:
    """Each link as six points with its mass, centre and inertia; the points of both as one body."""
    points, masses = [], []
    for name in ("panda_link7", "panda_hand"):
        own = source.link_map[name].inertial
        second = 0.5 * np.trace(own.inertia) * np.eye(3) - own.inertia
        values, axes = np.linalg.eigh(second)
        frame = source.get_transform(name, "panda_link7")
        for value, axis in zip(values, axes.T, strict=True):
            assert value > 0
            for sign in (1, -1):  # 2 (m/6) d^2 = the second moment along this axis
                local = own.origin[:3, 3] + sign * axis * np.sqrt(3 * value / own.mass)
                points.append(frame[:3, :3] @ local + frame[:3, 3])
                masses.append(own.mass / 6)
    com = np.average(points, axis=0, weights=masses)
    arms = [p - com for p in points]
    tensor = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, arms, strict=True))
    body = next(b for b in panda.bodies if b.name == "panda.panda_link7").inertial
    np.testing.assert_allclose(body.com, com, atol=1e-12)
    xx, yy, zz, xy, xz, yz = body.inertia
    np.testing.assert_allclose([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], tensor, atol=1e-9)


def test_home_points_the_tool_down_in_front(panda: World) -> None:
    frame = find_frame(panda, "panda.tool")
    tool = P.compose(panda.initial_body_pose[frame.body], P.pose(frame.position, frame.quaternion))
    x, _, z = P.to_matrix(tool[3:]).T
    np.testing.assert_allclose(z, (0, 0, -1), atol=1e-9)
    np.testing.assert_allclose(x, (1, 0, 0), atol=1e-9)
    np.testing.assert_allclose(tool[:3], (0.505, 0.0, 0.304), atol=1e-3)


def test_the_tool_lies_between_the_fingers_with_y_along_the_opening(panda: World) -> None:
    tool = find_frame(panda, "panda.tool")
    pose = P.compose(panda.initial_body_pose[tool.body], P.pose(tool.position, tool.quaternion))
    inverse = P.inverse(pose)
    for name, side in (("panda.panda_leftfinger", 1), ("panda.panda_rightfinger", -1)):
        body = next(i for i, b in enumerate(panda.bodies) if b.name == name)
        local = P.compose(inverse, panda.initial_body_pose[body])
        np.testing.assert_allclose(local[:2], (0, side * 0.04), atol=1e-9)
        assert local[2] < 0  # the finger's frame lies behind, towards the hand


def test_drives_and_channels(panda: World) -> None:
    (robot,) = panda.robots
    assert list(robot.channels) == ["arm", "eef"]
    assert robot.channels["arm"].joints == tuple(range(7))
    drives = [panda.actuators[i] for i in robot.channels["arm"].actuators]
    assert [d.effort_limit for d in drives] == [87.0] * 4 + [12.0] * 3
    assert {d.mode for d in drives} == {ControlMode.POSITION}
    eef = robot.channels["eef"]
    for finger, closed in zip(eef.actuators, eef.closed or (), strict=True):
        drive = panda.actuators[finger]
        assert drive.kp * (0.0 - closed) >= drive.effort_limit  # a closed command saturates at any width
    fingers = [panda.joints[j] for j in eef.joints]
    assert fingers[1].mimic is not None
    assert fingers[1].mimic.joint == eef.joints[0]
    assert all(f.limit_softness == 0.004 and f.armature == 0.1 and f.initial == 0.04 for f in fingers)
    assert panda.joints[0].limit_softness == 0.0


def test_pads_shapes_and_colours(panda: World) -> None:
    pads = [g for g in panda.geoms if g.collides and "finger" in g.name]
    assert all(isinstance(g.shape, Box) for g in pads)
    assert all(g.surface.softness == 0.004 and g.surface.friction == 1.0 and g.surface.torsional for g in pads)
    rest = [g for g in panda.geoms if g.collides and g.body >= 0 and "finger" not in g.name]
    assert all(isinstance(g.shape, MeshShape) and g.surface.softness == 0 and not g.visible for g in rest)
    colors = {g.color[:3] for g in panda.geoms if g.visible}
    assert (1.0, 1.0, 1.0) in colors
    assert any(max(c) < 0.3 for c in colors)
    assert max(len(m.faces) for m in panda.meshes) < 7_500  # of 15,074 in its heaviest file


def test_flags(panda: World) -> None:
    assert panda.bodies[0].kind is BodyKind.STATIC
    assert [b.gravity_compensation for b in panda.bodies] == [False] + [True] * 9
    parents = {(b.parent, i) for i, b in enumerate(panda.bodies)}
    assert len(panda.excluded_pairs) == 45 - 9
    assert not parents & panda.excluded_pairs
    assert all(low < high for low, high in panda.excluded_pairs)
    assert panda.entities[0].license == "Apache-2.0"
    assert panda.entities[0].source.startswith("example-robot-data:")

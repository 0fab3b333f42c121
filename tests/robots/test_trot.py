"""Quadrupeds stand, trot forward, sidestep and turn on every engine, with one controller."""

import numpy as np
import pytest

from anysim.testing.quadrupeds import QUADRUPEDS, WITH_ARM, made, stand, walk
from tests.tiers import by_turns

SPEED = {"unitree_go1": 0.5, "unitree_go2": 0.5, "unitree_b1": 0.5, "anymal_b": 0.5, "solo12": 0.3}
"""[m/s] forward, of five robots that differ in size, knees and feet; half of it to the side."""


@pytest.mark.parametrize(("robot", "engine"), by_turns(SPEED))
def test_trots_sidesteps_and_turns(robot: str, engine: str) -> None:
    forward = SPEED[robot]
    commands = np.array([[forward, 0.0, 0.0], [0.0, 0.5 * forward, 0.0], [0.0, 0.0, 0.6]])
    with made(robot, engine, 3) as env:
        walked = walk(env, commands, 7.0)
    assert not walked.fell.any(), f"fell: {walked}"
    assert walked.place[0, 0] > 6.0 * forward, "three metres in seven seconds, at half a metre a second"
    for row in range(3):
        assert abs(walked.velocity[row, row] / commands[row, row] - 1.0) < 0.12, walked.velocity
    assert np.rad2deg(walked.tilt.max()) < 10.0


@pytest.mark.slow
@pytest.mark.parametrize("robot", WITH_ARM)
def test_walks_with_an_arm(robot: str) -> None:
    with made(robot, "mujoco", 3) as env:
        walked = walk(env, np.array([[0.3, 0.0, 0.0], [0.0, 0.15, 0.0], [0.0, 0.0, 0.4]]), 5.0)
        arm = env.actions.slice_of("robot", "arm").controller
        arm.robot.see(env.engine.get_state())
        held = arm.robot.joint_pos(None)[:, arm.channel.joint_columns]
        assert np.abs(held - stand(env)[:, 3 : 3 + held.shape[1]]).max() < 0.1, "the arm is held"
    assert not walked.fell.any(), f"fell: {walked}"
    assert np.abs(np.diagonal(walked.velocity) / [0.3, 0.15, 0.4] - 1.0).max() < 0.12


@pytest.mark.slow
@pytest.mark.parametrize("robot", [*QUADRUPEDS, *WITH_ARM])
def test_stands_at_home(robot: str) -> None:
    for controller in ("default", "joint_position"):
        with made(robot, "mujoco", 1, controller) as env:
            assert off_home(env, 5.0) < 0.05, controller


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
@pytest.mark.parametrize("robot", ["unitree_go1", "anymal_c", "solo12"])
def test_stands_at_home_elsewhere(robot: str, engine: str) -> None:
    with made(robot, engine, 1) as env:
        assert off_home(env, 5.0) < 0.05


def off_home(env, seconds: float) -> float:
    """How far [rad] a joint of the legs came off home."""
    env.reset(seed=0)
    action, worst = stand(env), 0.0
    robot = env.actions.slices[0].controller.robot
    legs = env.actions.slices[0].controller.channel.joint_columns
    for _ in range(round(seconds / 0.02)):
        env.step(action)
        joints = env.engine.get_state().joint_pos[0, robot.joints]
        worst = max(worst, float(np.abs(joints - robot.kinematics.initial)[legs].max()))
    return worst


@pytest.mark.slow
def test_snapshots_continue_the_same_walk_and_rows_are_alone() -> None:
    commands = np.array([[0.4, 0.0, 0.0], [0.0, 0.2, 0.3]])
    with made("unitree_go1", "mujoco", 2) as env:
        env.reset(seed=0)
        for _ in range(30):
            env.step(commands)
        kept = env.snapshot()
        ends = []
        for _ in range(2):
            for _ in range(30):
                env.step(commands)
            ends.append(env.engine.get_state().joint_pos.copy())
            env.reset_to(kept)
        assert (ends[0] == ends[1]).all()
    with made("unitree_go1", "mujoco", 1) as env:
        env.reset(seed=0)
        for _ in range(60):
            env.step(commands[:1])
        assert (env.engine.get_state().joint_pos[0] == ends[0][0]).all(), "row 0 does not know row 1"

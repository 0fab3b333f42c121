"""Controllers of tools on drives that are perfect: they arrive, within limits, and a row is its own."""

from typing import Any

import numpy as np
import pytest

from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.testing.tracking import Circle, Puppet, errors, robot_world

WORLD = robot_world("franka_panda", yaw=0.7, position=[0.3, -0.2, 0.1])
IK = ("differential_ik", "pink_ik", "mink_ik", "batched_ik")
OFFSET = np.array([0.08, 0.15, 0.1])


def puppet(controller: str, num_envs: int = 1, **params: Any) -> Puppet:
    return Puppet(WORLD, controller, num_envs=num_envs, **params).reset()


def beside(pose: np.ndarray) -> np.ndarray:
    """Poses some way off, turned by 0.3 rad."""
    turn = P.from_axis_angle(np.array([0.6, 0.0, 0.8]), np.array(0.3))
    return np.concatenate(
        [pose[:, :3] + OFFSET, P.multiply(np.broadcast_to(turn, (len(pose), 4)), pose[:, 3:])], axis=1
    )


@pytest.mark.parametrize("controller", IK)
def test_it_arrives_within_the_velocity_limits(controller: str) -> None:
    robot = puppet(controller, frame="world")
    target = beside(robot.tool())
    most = robot.view.velocity_limit * robot.robot.control_dt
    for _ in range(60):
        before = robot.joint_pos[:, robot.columns].copy()
        robot.step(target)
        assert (np.abs(robot.joint_pos[:, robot.columns] - before) <= most + 1e-9).all()
    found = errors(target, robot.tool())
    assert found.rms < 1e-4, found
    assert found.turn < 1e-4, found


@pytest.mark.parametrize("controller", IK)
def test_drives_are_led_by_half_a_step_and_the_velocity(controller: str) -> None:
    robot = puppet(controller, frame="world")
    before = robot.joint_pos[:, robot.columns].copy()
    command = robot.step(beside(robot.tool()))
    after = robot.joint_pos[:, robot.columns]
    assert command.position is not None
    assert command.velocity is not None
    assert np.abs(after - before).max() > 1e-3
    np.testing.assert_allclose(command.position, 0.5 * (before + after), atol=1e-12)
    np.testing.assert_allclose(command.velocity, (after - before) / robot.robot.control_dt, atol=1e-9)


@pytest.mark.parametrize("controller", IK)
def test_out_of_reach_it_stays_within_the_joint_limits(controller: str) -> None:
    robot = puppet(controller)
    far = robot.controller.high.copy()
    far[3:] = [0.0, 0.0, 0.0, 1.0]
    for _ in range(80):
        robot.step(far[None])
    position = robot.joint_pos[:, robot.columns]
    assert np.isfinite(position).all()
    assert (position >= robot.view.lower - 1e-9).all()
    assert (position <= robot.view.upper + 1e-9).all()


@pytest.mark.parametrize("controller", IK)
def test_the_posture_does_not_move_the_tool(controller: str) -> None:
    robot = puppet(controller, frame="world", posture_gain=0.05)
    target = robot.tool()
    reference = robot.controller._reference
    # the elbow elsewhere, the tool where it was: along the nullspace, then held
    home = reference.copy()
    elsewhere = home + np.array([0.4, 0.0, -0.4, 0.0, 0.3, 0.0, 0.0])
    robot.controller._posture[:] = np.clip(elsewhere, robot.view.lower, robot.view.upper)
    for _ in range(120):
        robot.step(target)
    assert np.abs(robot.joint_pos[:, robot.columns] - home).max() > 0.02, "the posture pulls"
    assert errors(target, robot.tool()).rms < 5e-5
    assert errors(target, robot.tool()).turn < 2e-4


@pytest.mark.parametrize("controller", IK)
def test_a_row_is_the_same_bits_in_any_batch(controller: str) -> None:
    offsets = np.array([[0.1, 0.0, 0.05], [-0.05, 0.2, 0.0], [0.0, -0.3, 0.2], [5.0, 0.0, 0.0]])
    whole = puppet(controller, 4, frame="world")
    start = whole.tool()
    start[:, :3] += offsets
    for _ in range(8):
        whole.step(start)
    for row in range(4):
        alone = puppet(controller, 1, frame="world")
        for _ in range(8):
            alone.step(start[row : row + 1])
        assert (alone.joint_pos[0] == whole.joint_pos[row]).all()


@pytest.mark.parametrize("controller", IK)
@pytest.mark.parametrize("command", ["delta", "twist", "position"])
def test_a_restored_snapshot_goes_on_as_before(controller: str, command: str) -> None:
    robot = puppet(controller, 2, command=command)
    action = np.array([[0.5, -0.4, 0.3, 0.1, 0.2, -0.3][: robot.controller.dim]] * 2)
    for _ in range(3):
        robot.step(action)
    ids = np.array([1])
    kept, joints = robot.controller.snapshot(ids), robot.joint_pos[1].copy()
    first = [robot.step(action).position[1] for _ in range(3)]
    robot.controller.restore(ids, kept)
    robot.joint_pos[1] = joints
    robot.see()
    again = [robot.step(action[:1], ids).position[0] for _ in range(3)]
    assert (np.array(first) == np.array(again)).all()


def test_steps_and_speeds_move_the_target_and_do_not_wind_up() -> None:
    for command, move in (("delta", 0.02), ("twist", 0.5 * 0.02)):
        robot = puppet("differential_ik", frame="world", command=command)
        start = robot.tool()
        for _ in range(5):
            robot.step(np.array([[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]]))
        for _ in range(5):  # faster than the joints may be: the target waits
            robot.step(np.zeros((1, 6)))
        np.testing.assert_allclose(robot.tool()[0, :3] - start[0, :3], [0.0, 5 * move, 0.0], atol=1e-4)
    for _ in range(300):
        robot.step(np.array([[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]]))
    stretched = robot.tool()
    for _ in range(30):
        robot.step(np.array([[0.0, -1.0, 0.0, 0.0, 0.0, 0.0]]))
    assert robot.tool()[0, 1] < stretched[0, 1] - 0.1, "it comes back at once"


def test_the_base_frame_turns_with_the_base() -> None:
    robot = puppet("pink_ik", command="delta")
    start = robot.tool()
    robot.step(np.array([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]]))
    robot.step(np.zeros((1, 6)))
    np.testing.assert_allclose(
        robot.tool()[0, :3] - start[0, :3], 0.02 * np.array([np.cos(0.7), np.sin(0.7), 0.0]), atol=1e-4
    )


def test_action_for_brings_tools_to_where_joint_targets_have_them() -> None:
    robot = puppet("pink_ik")
    wanted = robot.joint_pos[:, robot.columns] + 0.05
    action = robot.controller.action_for(wanted, np.array([0]))
    for _ in range(20):
        robot.step(action)
    reached = robot.tool()
    robot.joint_pos[:, robot.columns] = wanted
    robot.see()
    assert errors(robot.tool(), reached).rms < 1e-4


def test_pink_and_mink_solve_the_same_problem() -> None:
    ends = []
    for controller in ("pink_ik", "mink_ik"):
        robot = puppet(controller, frame="world")
        start = robot.tool()
        for step in range(30):
            robot.step(Circle().pose(start, 0.02 * (step + 1)))
        ends.append(robot.joint_pos[0])
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6)


def test_both_hands_of_a_humanoid_are_one_action() -> None:
    robot = Puppet(robot_world("unitree_g1"), "pink_ik").reset()
    assert robot.controller.dim == 14
    assert robot.controller.labels[0] == "left_hand.x"
    poses = np.stack([robot.tool("left_hand"), robot.tool("right_hand")], axis=1)
    base = robot.robot.base_pose(None)
    target = P.compose(P.inverse(base)[:, None], poses)
    target[..., 2] += 0.05
    target[..., 0] += 0.05
    for _ in range(60):
        robot.step(target.reshape(1, 14))
    for tool, side in (("left_hand", 0), ("right_hand", 1)):
        wanted = P.compose(base, target[:, side])
        assert errors(wanted, robot.tool(tool)).rms < 1e-4


def test_unknown_tools_are_refused_by_name() -> None:
    with pytest.raises(TaskError, match="there is no tool 'tol'; did you mean 'tool'"):
        puppet("pink_ik", tool="tol")
    with pytest.raises(TaskError, match="moves no tool"):
        Puppet(WORLD, "pink_ik", channel="eef")

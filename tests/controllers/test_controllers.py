"""Controllers: actions to drive targets, and back."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from anysim.controllers.base import ChannelView
from anysim.controllers.gripper import GripperBinary, GripperContinuous, GripperForce
from anysim.controllers.joint import JointDeltaPosition, JointPosition
from anysim.controllers.robot import ControlledRobot
from anysim.errors import TaskError


def channel(name: str, lower: list[float], upper: list[float], ends: tuple[list[float], list[float]] | None = None):
    """A channel of drives that no robot has."""
    k = len(lower)
    far = np.full(k, np.inf)
    opened, closed = (None, None) if ends is None else (np.array(ends[0]), np.array(ends[1]))
    robot = cast(ControlledRobot, SimpleNamespace(name="r"))
    return ChannelView(
        name,
        np.arange(k),
        slice(0, k),
        np.array(lower),
        np.array(upper),
        far,
        far,
        np.ones(k),
        np.ones(k),
        opened,
        closed,
        robot,
        np.arange(k),
    )


ARM = channel("arm", [-1.0, -2.0], [1.0, 2.0])
HAND = channel("eef", [0.0], [0.04], ([0.04], [-0.01]))


def test_joint_position_is_the_target() -> None:
    controller = JointPosition(ARM, 2)
    action = np.array([[0.5, -1.5], [0.0, 2.0]])
    assert (controller.apply(action, None).position == action).all()
    assert (controller.low == [-1, -2]).all()


def test_joint_delta_adds_up_inside_the_limits() -> None:
    controller = JointDeltaPosition(ARM, 2, scale=0.4)
    controller.reset(np.array([0, 1]), np.array([[0.0, 0.0], [0.9, 0.0]]))
    targets = controller.apply(np.ones((2, 2)), None).position
    assert np.allclose(targets, [[0.4, 0.4], [1.0, 0.4]])
    targets = controller.apply(np.array([[-1.0, 0.0]]), np.array([1])).position
    assert np.allclose(targets, [[0.6, 0.4]]), "a clipped target does not wind up"


def test_joint_delta_action_for_reaches_the_target_when_it_can() -> None:
    controller = JointDeltaPosition(ARM, 1, scale=0.1)
    ids = np.array([0])
    controller.reset(ids, np.array([[0.2, 0.2]]))
    wanted = np.array([[0.25, 1.0]])
    action = controller.action_for(wanted, ids)
    assert np.allclose(action, [[0.5, 1.0]])
    assert np.allclose(controller.apply(action, ids).position, [[0.25, 0.3]])


def test_snapshots_hold_the_targets() -> None:
    controller = JointDeltaPosition(ARM, 2, scale=0.1)
    controller.reset(np.array([0, 1]), np.zeros((2, 2)))
    controller.apply(np.ones((2, 2)), None)
    kept = controller.snapshot(np.array([1]))
    controller.apply(np.ones((2, 2)), None)
    controller.restore(np.array([1]), kept)
    assert np.allclose(controller.apply(np.zeros((2, 2)), None).position, [[0.2, 0.2], [0.1, 0.1]])


def test_gripper_binary() -> None:
    controller = GripperBinary(HAND, 3)
    assert np.allclose(controller.apply(np.array([[1.0], [0.0], [-0.1]]), None).position, [[0.04], [0.04], [-0.01]])
    assert np.allclose(controller.action_for(np.array([[0.04], [-0.01]]), np.array([0, 1])), [[1.0], [-1.0]])
    with pytest.raises(TaskError, match="no `opened` and `closed` targets"):
        GripperBinary(ARM, 1)


def test_a_gripper_presses_with_the_share_of_its_force_and_closes_as_fast_with_any() -> None:
    """5 N of 20: the target is 5 N / kp beyond the finger; while it moves, its damping is added, up to the limit."""
    place, speed = np.array([[0.03]]), np.array([[0.0]])
    robot = SimpleNamespace(name="r", dt=0.002, control_dt=0.02, joint_pos=lambda _: place, joint_vel=lambda _: speed)
    hand = replace(
        HAND,
        robot=cast(ControlledRobot, robot),
        kp=np.array([1e3]),
        kd=np.array([300.0]),
        effort_limit=np.array([20.0]),
    )
    controller, ids, little = GripperForce(hand, 1), np.array([0]), np.array([[-0.25]])
    controller.reset(ids, place)
    assert (controller.period, controller.low, controller.high) == (0.002, -1.0, 1.0)
    assert np.allclose(controller.apply(little, ids).position, 0.03 - 0.005)
    speed[:] = -0.02
    assert np.allclose(controller.update(ids).position, 0.03 - 0.005), "it has not moved on: chatter"
    place = place - 0.0004
    assert np.allclose(controller.apply(little, ids).position, 0.0296 - 0.005 - 0.006)
    speed[:] = 0.0
    assert np.allclose(controller.update(ids).position, 0.0296 - 0.005), "it has touched"
    place, speed[:] = place - 0.004, -0.2
    assert np.allclose(controller.apply(little, ids).position, 0.0256 - 0.02), "never more than the limit"
    assert np.allclose(controller.apply(np.array([[-1.0]]), ids).position, -0.01), "all of it: as gripper_binary"
    kept = controller.snapshot(ids)
    assert np.allclose(controller.apply(np.array([[0.0]]), ids).position, 0.04)
    controller.restore(ids, kept)
    assert np.allclose(controller.update(ids).position, -0.01)
    with pytest.raises(TaskError, match="no effort limit of which gripper_force takes a share"):
        GripperForce(HAND, 1)


def test_a_continuous_gripper_opens_as_far_as_it_is_told_and_closes_beyond_contact() -> None:
    controller = GripperContinuous(HAND, 3)
    targets = controller.apply(np.array([[1.0], [0.25], [0.0]]), None).position
    assert np.allclose(targets, [[0.04], [0.01], [-0.01]])
    wide = GripperContinuous(HAND, 1, range=(0.0, 0.08))
    assert np.allclose(wide.apply(np.array([[0.02]]), None).position, [[0.01]])
    assert np.allclose(wide.action_for(np.array([[0.01], [-0.01], [0.07]]), np.arange(3))[:, 0], [0.02, 0.0, 0.08])
    with pytest.raises(TaskError, match=r"the range \[1\.0, 0\.0\] has to rise"):
        GripperContinuous(HAND, 1, range=(1.0, 0.0))
    with pytest.raises(TaskError, match="which gripper_continuous needs"):
        GripperContinuous(ARM, 1)


def test_a_continuous_gripper_keeps_its_speed_and_does_not_wind_up() -> None:
    """Blocked at 20 mm, its target stays within effort_limit / kp of the finger, and leaves at once when it opens."""
    finger = np.array([[0.04]])
    robot = SimpleNamespace(name="r", control_dt=0.02, joint_pos=lambda env_ids: finger)
    hand = replace(HAND, robot=cast(ControlledRobot, robot), kp=np.array([1000.0]), effort_limit=np.array([5.0]))
    controller = GripperContinuous(hand, 1, speed=2.0)
    controller.reset(np.array([0]), np.array([[0.04]]))
    step = 2.0 * 0.02 * 0.04
    for k in range(1, 4):
        assert np.allclose(controller.apply(np.zeros((1, 1)), None).position, 0.04 - k * step)
    finger[:] = 0.02
    for _ in range(50):
        controller.apply(np.zeros((1, 1)), None)
    assert np.allclose(controller.snapshot(np.array([0]))["target"], 0.015)
    assert np.allclose(controller.apply(np.ones((1, 1)), None).position, 0.015 + step)

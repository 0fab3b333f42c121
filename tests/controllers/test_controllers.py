"""Controllers: actions to drive targets, and back."""

import numpy as np
import pytest

from anysim.controllers.base import ChannelView
from anysim.controllers.gripper import GripperBinary
from anysim.controllers.joint import JointDeltaPosition, JointPosition
from anysim.errors import TaskError

ARM = ChannelView(
    "arm", np.array([0, 1]), slice(0, 2), np.array([-1.0, -2.0]), np.array([1.0, 2.0]), np.full(2, np.inf), None, None
)
HAND = ChannelView(
    "eef", np.array([2]), slice(2, 3), np.array([0.0]), np.array([0.04]), np.full(1, np.inf), np.array([0.04]),
    np.array([-0.01]),
)  # fmt: skip


def test_joint_position_is_the_target() -> None:
    controller = JointPosition(ARM, 2)
    action = np.array([[0.5, -1.5], [0.0, 2.0]])
    assert (controller.apply(action, None) == action).all()
    assert (controller.low == [-1, -2]).all()


def test_joint_delta_adds_up_inside_the_limits() -> None:
    controller = JointDeltaPosition(ARM, 2, scale=0.4)
    controller.reset(np.array([0, 1]), np.array([[0.0, 0.0], [0.9, 0.0]]))
    targets = controller.apply(np.ones((2, 2)), None)
    assert np.allclose(targets, [[0.4, 0.4], [1.0, 0.4]])
    targets = controller.apply(np.array([[-1.0, 0.0]]), np.array([1]))
    assert np.allclose(targets, [[0.6, 0.4]]), "a clipped target does not wind up"


def test_joint_delta_action_for_reaches_the_target_when_it_can() -> None:
    controller = JointDeltaPosition(ARM, 1, scale=0.1)
    ids = np.array([0])
    controller.reset(ids, np.array([[0.2, 0.2]]))
    wanted = np.array([[0.25, 1.0]])
    action = controller.action_for(wanted, ids)
    assert np.allclose(action, [[0.5, 1.0]])
    assert np.allclose(controller.apply(action, ids), [[0.25, 0.3]])


def test_snapshots_hold_the_targets() -> None:
    controller = JointDeltaPosition(ARM, 2, scale=0.1)
    controller.reset(np.array([0, 1]), np.zeros((2, 2)))
    controller.apply(np.ones((2, 2)), None)
    kept = controller.snapshot(np.array([1]))
    controller.apply(np.ones((2, 2)), None)
    controller.restore(np.array([1]), kept)
    assert np.allclose(controller.apply(np.zeros((2, 2)), None), [[0.2, 0.2], [0.1, 0.1]])


def test_gripper_binary() -> None:
    controller = GripperBinary(HAND, 3)
    assert np.allclose(controller.apply(np.array([[1.0], [0.0], [-0.1]]), None), [[0.04], [0.04], [-0.01]])
    assert np.allclose(controller.action_for(np.array([[0.04], [-0.01]]), np.array([0, 1])), [[1.0], [-1.0]])
    with pytest.raises(TaskError, match="no `opened` and `closed` targets"):
        GripperBinary(ARM, 1)

"""The controller of dexterous hands: blended postures, limits, speed, joints that follow others."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from anysim.controllers.base import ChannelView
from anysim.controllers.robot import ControlledRobot
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.model.parts import Mimic
from anysim_control.hand import GripperMultiFinger

DT = 0.02
ONE = np.array([0])


def channel(
    mimic: dict[int, Mimic] | None = None,
    synergies: dict[str, list[float]] | None = None,
    opened: list[float] | None = None,
    drives: tuple[int, ...] = (0, 1, 2),
    speed: float = np.inf,
) -> ChannelView:
    """A finger of three joints with limits [-1, 1], [0, 2] and [0, 2], of which `drives` make the channel."""
    lower, upper = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 2.0, 2.0])
    joints = [SimpleNamespace(name=f"r.j{i}", mimic=(mimic or {}).get(i)) for i in range(3)]
    entry = SimpleNamespace(name="finger", channels={"eef": SimpleNamespace(synergies=synergies or {})})
    robot = SimpleNamespace(
        name="r", world=SimpleNamespace(joints=joints), joints=np.arange(3), control_dt=DT, entry=entry
    )
    columns, k = np.array(drives), len(drives)
    return ChannelView(
        "eef",
        np.arange(k),
        slice(0, k),
        lower[columns],
        upper[columns],
        np.full(k, speed),
        np.full(k, np.inf),
        np.ones(k),
        np.ones(k),
        None if opened is None else np.array(opened),
        None,
        cast(ControlledRobot, robot),
        columns,
    )


def hand(num_envs: int = 1, **params: Any) -> GripperMultiFinger:
    """A controller of the three joints, of which two grasps are known."""
    grasps = {"power": [0.0, 1.5, 1.0], "pinch": [0.5, 1.0, 0.0]}
    view = channel(synergies=grasps, opened=[-0.5, 0.1, 0.2])
    made = GripperMultiFinger(view, num_envs, **{"mode": "synergies", **params})
    made.reset(np.arange(num_envs), np.tile([-0.5, 0.1, 0.2], (num_envs, 1)))
    return made


def commanded(controller: GripperMultiFinger, action: Array, env_ids: Array | None = None) -> Array:
    """The position targets (E, K) of one control step."""
    position = controller.apply(action, env_ids).position
    assert position is not None
    return position.copy()


def test_one_synergy_goes_from_opened_to_its_posture() -> None:
    controller = hand(3)
    assert (controller.dim, controller.labels) == (2, ("power", "pinch"))
    assert (controller.low == 0).all()
    assert (controller.high == 1).all()
    action = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.5]])
    position = commanded(controller, action)
    np.testing.assert_allclose(position, [[-0.5, 0.1, 0.2], [0.0, 1.5, 1.0], [0.0, 0.55, 0.1]], atol=1e-15)


def test_synergies_add_up_and_stay_within_the_limits() -> None:
    """opened + (power - opened) + (pinch - opened) = [1.0, 2.4, 0.8], of which the second is beyond its limit of 2."""
    np.testing.assert_allclose(commanded(hand(), np.array([[1.0, 1.0]])), [[1.0, 2.0, 0.8]], atol=1e-15)


def test_a_posture_of_the_catalogue_may_lie_beyond_a_limit_to_press() -> None:
    view = channel(synergies={"power": [0.0, 2.5, 1.0]}, opened=[0.0, 0.0, -0.1])
    controller = GripperMultiFinger(view, 1, mode="synergies")
    controller.reset(ONE, np.zeros((1, 3)))
    np.testing.assert_allclose(commanded(controller, np.array([[1.0]])), [[0.0, 2.5, 1.0]])
    np.testing.assert_allclose(commanded(controller, np.array([[0.0]])), [[0.0, 0.0, -0.1]])


def test_synergies_can_be_chosen() -> None:
    controller = hand(synergies=("pinch",))
    assert controller.labels == ("pinch",)
    np.testing.assert_allclose(commanded(controller, np.array([[1.0]])), [[0.5, 1.0, 0.0]])


def test_a_row_of_the_action_does_not_depend_on_the_rows_beside_it() -> None:
    rng = np.random.default_rng(0)
    action = rng.uniform(0, 1, (7, 2))
    together = hand(7).posture(action)
    for row in range(7):
        assert (hand().posture(action[row : row + 1])[0] == together[row]).all()


def test_targets_move_no_faster_than_the_speed() -> None:
    controller = hand(speed=5.0)  # 0.1 rad in a step
    close = np.array([[1.0, 0.0]])
    np.testing.assert_allclose(commanded(controller, close), [[-0.4, 0.2, 0.3]])
    for _ in range(3):
        controller.apply(close, None)
    np.testing.assert_allclose(commanded(controller, close), [[0.0, 0.6, 0.7]], atol=1e-12)
    np.testing.assert_allclose(commanded(controller, np.zeros((1, 2))), [[-0.1, 0.5, 0.6]], atol=1e-12)


def test_the_joints_own_velocity_limit_holds_where_the_speed_is_higher() -> None:
    controller = GripperMultiFinger(channel(speed=1.0), 1, speed=5.0)
    controller.reset(ONE, np.zeros((1, 3)))
    np.testing.assert_allclose(commanded(controller, np.ones((1, 3))), [[0.02, 0.02, 0.02]])


def test_all_joints_within_their_limits() -> None:
    controller = GripperMultiFinger(channel(), 1)
    assert controller.labels == ("j0", "j1", "j2")
    assert (controller.low == [-1, 0, 0]).all()
    assert (controller.high == [1, 2, 2]).all()
    action = np.array([[0.3, 1.1, 0.7]])
    assert (commanded(controller, action) == action).all()
    assert (controller.action_for(np.array([[3.0, 1.0, -1.0]]), ONE) == [[1.0, 1.0, 0.0]]).all()


def test_followers_are_not_commanded_and_go_where_their_leader_puts_them() -> None:
    """j1 follows j0, j2 follows j1: j2 = 0.5 (2 j0 + 0.1) + 0.2."""
    controller = GripperMultiFinger(channel({1: Mimic(0, 2.0, 0.1), 2: Mimic(1, 0.5, 0.2)}), 1)
    assert (controller.dim, controller.labels) == (1, ("j0",))
    controller.reset(ONE, np.zeros((1, 3)))
    np.testing.assert_allclose(commanded(controller, np.array([[0.4]])), [[0.4, 0.9, 0.65]])


def test_followers_keep_to_their_leader_in_synergies_and_at_any_speed() -> None:
    view = channel({1: Mimic(0, 2.0, 0.0)}, {"power": [0.8, 0.0, 1.0]}, [0.0, 0.0, 0.0])
    controller = GripperMultiFinger(view, 1, mode="synergies", speed=5.0)
    controller.reset(ONE, np.zeros((1, 3)))
    np.testing.assert_allclose(commanded(controller, np.array([[1.0]])), [[0.1, 0.2, 0.1]])


def test_action_for_inverts_the_blend() -> None:
    controller = hand(2)
    action = np.array([[0.3, 0.6], [0.9, 0.1]])
    np.testing.assert_allclose(controller.action_for(controller.posture(action), np.array([0, 1])), action, atol=1e-12)


def test_a_snapshot_holds_the_target_on_its_way() -> None:
    controller = hand(2, speed=5.0)
    close = np.tile([1.0, 0.0], (2, 1))
    controller.apply(close, None)
    kept = controller.snapshot(np.array([1]))
    expected = commanded(controller, close)
    controller.apply(close, None)
    controller.restore(np.array([1]), kept)
    position = commanded(controller, close)
    assert (position[1] == expected[1]).all()
    assert (position[0] != expected[0]).any()


def test_only_the_given_envs_move() -> None:
    controller = hand(3, speed=5.0)
    assert np.allclose(commanded(controller, np.array([[1.0, 0.0]]), np.array([2])), [[-0.4, 0.2, 0.3]])
    assert np.allclose(commanded(controller, np.zeros((3, 2))), [[-0.5, 0.1, 0.2]] * 3)


@pytest.mark.parametrize(
    ("view", "params", "words"),
    [
        (channel(), {"mode": "synergies"}, "has no `synergies` in the catalogue.*use `mode: joints`"),
        (channel(synergies={"power": [0, 0, 0]}), {"mode": "synergies"}, "has no `opened` posture in the catalogue"),
        (
            channel(synergies={"power": [0, 0, 0]}, opened=[0, 0, 0]),
            {"mode": "synergies", "synergies": ("powr",)},
            "no synergy 'powr'; did you mean 'power'",
        ),
        (
            channel(synergies={"power": [0, 0, 0]}, opened=[0, 0, 0]),
            {"mode": "synergies", "synergies": ("power", "power")},
            "'power' is chosen twice",
        ),
        (channel(synergies={"power": [0, 0, 0]}), {"synergies": ("power",)}, "its `mode` is joints"),
        (channel({2: Mimic(0, 1.0, 0.0)}, drives=(1, 2)), {}, "'j2' follows 'j0', which is not in the channel 'eef'"),
    ],
)
def test_what_does_not_fit_is_refused(view: ChannelView, params: dict[str, Any], words: str) -> None:
    with pytest.raises(TaskError, match=words):
        GripperMultiFinger(view, 1, **params)

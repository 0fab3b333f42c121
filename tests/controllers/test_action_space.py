"""The action by channel: names, labels, and that it means the same as the flat vector."""

import numpy as np
import pytest

import anysim
from anysim.errors import TaskError
from tests.task.helpers import BLIND, arm, blocks

TWO = {
    "engine": "null",
    "world": {
        "name": "two",
        "robots": {
            "left": {"robot": "franka_panda", "actions": {"arm": "joint_delta_position", "eef": "gripper_binary"}},
            "right": {"robot": "franka_panda", "position": [0, 1, 0], "actions": {"arm": "joint_position"}},
        },
    },
    "task": {"horizon": 50, "observations": {"policy": [{"term": "joint_pos", "robot": "left"}, "last_action"]}},
}


def test_the_spaces_are_the_flat_action_in_pieces() -> None:
    with anysim.make(TWO, num_envs=2) as env:
        spaces = env.action_spaces
        assert list(spaces) == ["left.arm", "left.eef", "right.arm"]
        assert [s.dim for s in spaces.values()] == [7, 1, 7]
        low, high = env.action_bounds
        assert (np.concatenate([s.low for s in spaces.values()]) == low).all()
        assert (np.concatenate([s.high for s in spaces.values()]) == high).all()
        assert spaces["left.arm"].labels[0] == "panda_joint1"
        assert spaces.labels[7] == "left.eef.open"
        assert len(spaces.labels) == env.action_dim == spaces.dim == 15
        assert len(set(spaces.labels)) == 15
        assert spaces.get("left.arm") is spaces["left.arm"]
        assert spaces.get("left.leg") is None
        flat = np.random.default_rng(0).normal(size=(2, 15))
        assert (spaces.flatten(spaces.unflatten(flat), 2) == flat).all()
        parts = spaces.unflatten(flat)
        parts["left.arm"][:] = 0.0
        assert flat[:, :7].all(), "the parts are copies"


def test_a_named_step_is_the_flat_step() -> None:
    with anysim.make(TWO, num_envs=3) as a, anysim.make(TWO, num_envs=3) as b:
        rng = np.random.default_rng(1)
        a.reset(seed=3)
        b.reset(seed=3)
        for step in range(6):
            action = rng.uniform(-0.5, 0.5, (3, a.action_dim))
            named = a.action_spaces.unflatten(action)
            shuffled = {name: named[name] for name in reversed(list(named))}
            mask = np.array([True, step % 2 == 0, True])
            one, two = a.step(action, mask), b.step(shuffled, mask)
            assert (one.obs["policy"] == two.obs["policy"]).all()
            if step == 3:  # a reset of some leaves the others' commands alone
                again = np.array([False, True, False])
                first, second = a.reset(mask=again)[0], b.reset(mask=again)[0]
                assert (first["policy"] == second["policy"]).all()
                assert (a.obs["policy"] == b.obs["policy"]).all()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda a: {**a, "left.am": a["left.arm"]}, "no channel 'left.am' takes an action; did you mean 'left.arm'"),
        (lambda a: {"left.arm": a["left.arm"]}, "nothing for 'left.eef', 'right.arm'"),
        (lambda a: {**a, "left.eef": np.zeros(2)}, r"'left.eef' must have shape \(2, 1\), got \(2,\).*open"),
        (lambda a: {**a, "left.eef": np.full((2, 1), np.nan)}, "not a number"),
    ],
)
def test_what_is_wrong_with_a_named_action_is_said(change, words: str) -> None:
    with anysim.make(TWO, num_envs=2) as env:
        env.reset(seed=0)
        fine = env.action_spaces.unflatten(np.zeros((2, env.action_dim)))
        with pytest.raises(TaskError, match=words):
            env.step(change(fine))
        env.step(fine)


def test_a_world_without_robots_takes_an_empty_action() -> None:
    with blocks(2) as env:
        env.reset(seed=0)
        assert len(env.action_spaces) == 0
        env.step({})
        with pytest.raises(TaskError, match="no channel 'arm'"):
            env.action_spaces["arm"]


def test_a_flat_action_of_another_width_is_refused() -> None:
    with arm(1) as env, pytest.raises(TaskError, match="8 components in its last axis"):
        env.action_spaces.unflatten(np.zeros((1, 7)))


def test_recordings_name_the_components_by_joint() -> None:
    from anysim_recording.collector import run_header

    with anysim.make("pick_cube", engine="null", overrides=list(BLIND)) as env:
        names = run_header(env, 0).layout.action
        assert names[:2] == ("panda.arm.panda_joint1", "panda.arm.panda_joint2")
        assert names[7] == "panda.eef.open"

"""Predicates made of others, those that remember, and what success and failure are worth."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import SpecError
from anysim.task.env import TaskEnv
from anysim.task.term_registry import bind
from tests.task.helpers import BLOCKS, arm, blocks
from tests.task.test_place_terms import put

HIGH = {"high": {"term": "above", "a": "red", "b": "table", "height": 0.8, "tolerance": 0.3, "distance": 9.0}}
TILTED = {"tilted": {"term": "not", "of": {"upright": {"frame": "red"}}}}


def predicate(env: TaskEnv, term: str, **params: Any) -> Callable[[], Any]:
    """A predicate bound to the env's scene."""
    call = bind("predicate", term, params, env.scene, "test")
    return lambda: call().tolist()


def placed(env: TaskEnv, height: float, pitch: float = 0.0) -> None:
    """The red block at a height, at the beginning of a control step of its own."""
    env.step(np.zeros((env.num_envs, 0)))
    put(env, "red", (0.0, 0.0, height), (0.0, pitch, 0.0))


def ended(success: dict[str, Any], failure: dict[str, Any] | None = None, **task: Any) -> TaskEnv:
    """Two envs of the blocks task with other endings."""
    mdp = {**BLOCKS["task"], "success": success, "failure": failure or {}, "rewards": {}, **task}
    return anysim.make({**BLOCKS, "task": mdp}, num_envs=2)


@pytest.mark.parametrize(
    ("term", "more", "truths"),
    [
        ("all", {}, [False, False, False, True]),
        ("any", {}, [False, True, True, True]),
        ("not", {}, [True, False, False, False]),
        ("k_of", {"count": 1}, [False, True, True, True]),
        ("k_of", {"count": 2}, [False, False, False, True]),
    ],
)
def test_what_a_combination_says_of_two_predicates(term: str, more: dict[str, Any], truths: list[bool]) -> None:
    with blocks() as env:
        env.reset(seed=0)
        holds = predicate(env, term, of={**HIGH, **TILTED}, **more)
        for (height, pitch), said in zip([(0.2, 0.0), (0.9, 0.0), (0.2, 1.0), (0.9, 1.0)], truths, strict=True):
            put(env, "red", (0.0, 0.0, height), (0.0, pitch, 0.0))
            assert holds() == [said]


def test_hold_counts_control_steps_and_not_questions() -> None:
    with blocks() as env:
        env.reset(seed=0)
        holds = predicate(env, "hold", of=HIGH, steps=2)
        said: list[bool] = []
        for height in (0.9, 0.9, 0.2, 0.9, 0.9):
            placed(env, height)
            assert holds() == holds() == holds()
            said += holds()
        assert said == [False, True, False, False, True]
        env.reset(seed=0)
        placed(env, 0.9)
        assert holds() == [False], "an episode begins without a memory"


def test_after_wants_the_first_before_or_with_the_second() -> None:
    with blocks() as env:
        env.reset(seed=0)
        holds = predicate(env, "after", first=TILTED, of=HIGH)
        said: list[bool] = []
        for height, pitch in ((0.9, 0.0), (0.2, 1.0), (0.2, 0.0), (0.9, 0.0)):
            placed(env, height, pitch)
            said += holds()
        assert said == [False, False, False, True]


@pytest.mark.parametrize(("angle", "said"), [(6.5, True), (7.5, False), (-1.0, False)])
def test_turned_counts_whole_turns(angle: float, said: bool) -> None:
    with blocks() as env:
        env.reset(seed=0)
        turned = predicate(env, "turned", frame="red", angle=angle)
        for yaw in np.arange(1.0, 8.1, 1.0):  # seven radians after the first
            env.scene.elapsed[:] += 1
            put(env, "red", (0.0, 0.0, 0.5), (0.0, 0.0, float(yaw)))
            holds = turned()
        assert holds == [said]


def test_followed_wants_the_points_in_their_order() -> None:
    path = [[0.1, 0.0, 0.5], [0.1, 0.1, 0.5]]
    with blocks() as env:
        env.reset(seed=0)
        followed = predicate(env, "followed", frame="red", b="table", path=path)
        said: list[bool] = []
        for place in (path[1], path[0], path[1]):
            env.scene.elapsed[:] += 1
            put(env, "red", np.add(place, (0.0, 0.0, 0.2)))
            said += followed()
        assert said == [False, False, True]


def test_a_snapshot_carries_what_terms_remember() -> None:
    with ended({"hold": {"of": {"upright": {"frame": "red"}}, "steps": 4}}) as env:
        env.reset(seed=0)
        for _ in range(2):
            env.step(np.zeros((2, 0)))
        middle = env.snapshot()
        statuses = [env.step(np.zeros((2, 0))).status.tolist() for _ in range(2)]
        env.reset(seed=1)
        env.reset_to(middle)
        assert [env.step(np.zeros((2, 0))).status.tolist() for _ in range(2)] == statuses
        assert statuses == [["running"] * 2, ["success"] * 2]


def test_success_and_failure_are_worth_their_rewards_in_the_step_in_which_they_end_an_episode() -> None:
    fell = {"term": "below", "frame": "red", "height": 0.3, "reward": -7.0}
    with ended({"hold": {"of": HIGH, "steps": 2, "reward": 5.0}}, {"fell": fell}) as env:
        env.reset(seed=0)
        root = env.engine.index.entity("red").root
        for steps, rewards in enumerate(([0.0, 0.0], [5.0, -7.0])):
            pose = np.zeros((2, 1, 7))
            pose[:, 0, 6], pose[0, 0, 2], pose[1, 0, 2] = 1.0, 0.9, 0.25 if steps else 0.5
            env.engine.set_body_state(pose, np.zeros((2, 1, 6)), None, [root])
            result = env.step(np.zeros((2, 0)))
            assert result.reward.tolist() == rewards
        assert result.status.tolist() == ["success", "failed"]


def test_faults_inside_are_told_at_their_keys() -> None:
    inside = {"near": {"a": "red", "b": "blue", "tolerance": 1.0}, "touching": {"sensor": "pad"}, "uprite": {}}
    with pytest.raises(SpecError) as told:
        ended({"any": {"of": inside}})
    assert "task.success.any.of.uprite" in str(told.value)
    inside.pop("uprite")
    with pytest.raises(SpecError) as told:
        ended({"any": {"of": inside}})
    assert [issue.path for issue in told.value.issues] == [
        "task.success.any.of.near.b",
        "task.success.any.of.touching.sensor",
    ]
    assert "declare it as `world.contact_sensors.pad" in str(told.value)


def test_stage_stops_at_the_first_that_does_not_hold() -> None:
    with blocks() as env:
        env.reset(seed=0)
        stage = bind("reward", "stage", {"of": {**HIGH, **TILTED}}, env.scene, "test")
        seen = bind("observation", "holds", {"of": {**HIGH, **TILTED}}, env.scene, "test")
        for height, pitch, said, each in ((0.2, 1.0, 0.0, [0, 1]), (0.9, 0.0, 0.5, [1, 0]), (0.9, 1.0, 1.0, [1, 1])):
            put(env, "red", (0.0, 0.0, height), (0.0, pitch, 0.0))
            assert stage().tolist() == [said]
            assert seen().tolist() == [each]


@pytest.mark.parametrize(("by", "said"), [(0.1, [False, True, True]), (-0.1, [False, False, False])])
def test_a_joint_has_moved_since_the_first_step(by: float, said: list[bool]) -> None:
    with arm() as env:
        env.reset(seed=0)
        moved = bind("predicate", "joint_moved", {"joint": "panda.panda_joint1", "by": by}, env.scene, "test")
        joint, found = env.engine.index.joint("panda.panda_joint1"), []
        for position in (0.3, 0.41, 0.4001):
            env.scene.elapsed[:] += 1
            env.engine.set_joint_state(np.array([[position]]), np.zeros((1, 1)), None, [joint])
            env.scene.look(None)
            found += moved().tolist()
        assert found == said


def test_progress_counts_what_has_held_in_its_order_and_loses_nothing() -> None:
    with blocks() as env:
        env.reset(seed=0)
        progress = bind("observation", "progress", {"of": {**TILTED, **HIGH}}, env.scene, "test")
        said: list[float] = []
        for height, pitch in ((0.9, 0.0), (0.2, 1.0), (0.2, 0.0), (0.9, 0.0), (0.2, 0.0)):
            placed(env, height, pitch)
            assert progress().tolist() == progress().tolist()
            said += progress()[:, 0].tolist()
        assert said == [0.0, 0.5, 0.5, 1.0, 1.0]
        env.reset(seed=0)
        assert progress().tolist() == [[0.0]]
        placed(env, 0.9, 1.0)
        assert progress().tolist() == [[1.0]], "one after the other in the same step"


def test_the_action_s_size_and_its_rate() -> None:
    with arm(2) as env:
        env.reset(seed=0)
        size, older, rate = (
            bind("reward", n, {}, env.scene, "t") for n in ("action_l2", "action_rate", "action_rate_l2")
        )
        before = np.zeros((2, env.action_dim))
        for seed in range(3):
            action = np.random.default_rng(seed).uniform(-1.0, 1.0, before.shape)
            env.step(action)
            np.testing.assert_allclose(size(), (action**2).sum(axis=1))
            assert size().tolist() == older().tolist()
            for _ in range(2):
                np.testing.assert_allclose(rate(), ((action - before) ** 2).sum(axis=1))
            before = action
        env.reset(mask=np.array([True, False]))
        assert rate().tolist() == [0.0], "an episode begins without an action"

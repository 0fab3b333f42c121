"""Values that callers of an env give: each that cannot be taken is refused with a sentence, and changes nothing."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import AnysimError, EngineError, SnapshotError, SpecError, TaskError
from anysim.task.env import TaskEnv
from tests.task.helpers import BLOCKS, arm, blocks

ITSELF: dict[str, Any] = {"world": {}}
ITSELF["world"]["objects"] = ITSELF
ENDLESS: list[Any] = []
ENDLESS.append(ENDLESS)


@pytest.fixture(scope="module")
def env() -> Any:
    with arm(2) as made:
        made.reset(seed=0)
        yield made


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"seed": 1.5}, "seed must be a whole number, got 1.5"),
        ({"seed": "ab"}, "seed must be a whole number, got 'ab'"),
        ({"seed": [1.5, 2]}, "seed must be a whole number"),
        ({"seed": 2**70}, r"seed must be from 0 to 2\^64 - 1"),
        ({"episode_seeds": [2**70, 1]}, r"episode_seeds must be from 0 to 2\^64 - 1"),
        ({"episode_seeds": [-1, 1]}, "episode_seeds must be from 0"),
        ({"episode_seeds": 5}, "episode_seeds must be a list of 2 whole numbers"),
        ({"episode_seeds": [1, 2, 3]}, "a list of 2 whole numbers, one for each env, got 3"),
        ({"mask": [[True], [True, False]]}, "mask has rows of different lengths"),
        ({"mask": [1, 0]}, "mask must be a bool array"),
        ({"overrides": 5}, "overrides must be a mapping from paths to values, or a list of 2"),
        ({"overrides": "layout.cube.x"}, "overrides must be a mapping"),
        ({"overrides": [5, 5]}, "overrides must be a mapping"),
        ({"overrides": {"layout.cube.x": ENDLESS}}, "'layout.cube.x' cannot be a list"),
    ],
)
def test_a_reset_refuses_what_it_cannot_take_and_nothing_moved(env: TaskEnv, asked: Any, told: str) -> None:
    before = env.streams.snapshot(np.arange(2)), env.obs["policy"]
    with pytest.raises(TaskError, match=told):
        env.reset(**asked)
    after = env.streams.snapshot(np.arange(2)), env.obs["policy"]
    assert repr(before) == repr(after)


def test_a_step_takes_real_numbers_alone(env: TaskEnv) -> None:
    rows = np.zeros((2, env.action_dim))
    for action in (rows + 1j, rows.astype("datetime64[s]"), np.ma.masked_array(rows, mask=True), rows.astype("U3")):
        with pytest.raises(TaskError, match="the action "):
            env.step(action)
    for action in ([[1.0], [1.0, 2.0]], "text", {"panda.arm": "text", "panda.eef": rows[:, :1]}, None):
        with pytest.raises(TaskError, match="the action "):
            env.step(action)
    assert (env.info["elapsed_steps"] == 0).all()


def test_a_snapshot_goes_into_envs_by_number(env: TaskEnv) -> None:
    with pytest.raises(SnapshotError, match=r"takes what snapshot\(\) of an env gives, got a str"):
        env.reset_to("snapshot")
    for ids in ("a", [1.5], [[0], [0, 1]]):
        with pytest.raises(EngineError, match="env indices"):
            env.reset_to(env.snapshot(np.array([True, False])), env_ids=ids)


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"num_envs": 0}, "num_envs must be from 1"),
        ({"num_envs": "2"}, "num_envs must be a whole number, got '2'"),
        ({"num_envs": 1.5}, "num_envs must be a whole number"),
        ({"engine": ""}, "engine is the name of an installed engine, or what a file's `engine` holds, got ''"),
        ({"engine": 5}, "engine is the name of an installed engine, or what a file's `engine` holds, got 5"),
        ({"engine": {}}, "engine is the name of an installed engine, or what a file's `engine` holds"),
        ({"engine": {"name": "null", "threads": print}}, "engine holds what no file can hold"),
        ({"seed": 1.5}, "seed must be a whole number"),
        ({"overrides": [5]}, r"overrides are a list of texts such as \['physics.dt=0.004'\]"),
        ({"overrides": "physics.dt=0.004"}, "overrides are a list of texts .* got 'physics.dt=0.004'"),
        ({"overrides": 5}, "overrides are a list of texts"),
    ],
)
def test_an_env_is_not_made_of_anything(asked: Any, told: str) -> None:
    with pytest.raises(TaskError, match=told):
        anysim.make(BLOCKS, **asked)


@pytest.mark.parametrize("source", [5, None, b"x", [1]])
def test_a_task_is_a_name_a_file_or_a_mapping(source: Any) -> None:
    with pytest.raises(TaskError, match="a task is given by the name of an installed one, a YAML file or a mapping"):
        anysim.make(source)


@pytest.mark.parametrize("data", [ITSELF, {"world": {"lights": ENDLESS}}])
def test_data_that_contains_itself_is_refused(data: Any) -> None:
    with pytest.raises(SpecError, match="more than 100 levels deep, or contains itself"):
        anysim.make(data)


def test_no_env_is_left_where_the_seed_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[object] = []
    monkeypatch.setattr(anysim.api, "simulation", built.append)
    with pytest.raises(AnysimError):
        anysim.make(BLOCKS, seed=-1)
    assert not built


def test_several_overrides_may_be_none() -> None:
    with blocks(2) as env:
        env.reset(seed=1, overrides=[])
        env.reset(seed=1, overrides=[{}, {"layout.red.x": np.float64(0.1)}])


def test_an_engine_is_given_as_a_file_gives_it() -> None:
    given = {"name": "mujoco", "options": {"threads": 1}}
    with anysim.make(BLOCKS, engine=given) as env:
        assert env.spec.engine.name == "mujoco"
        assert env.spec.engine.options == {"threads": 1}

"""Tasks under vla-eval's harness: episodes of a split, held against the same env, and run by the harness itself."""

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import TaskError
from anysim.testing.engines import require_engine
from anysim_adapters.vla_eval.tasks import EvalTasks
from anysim_evaluation.driver import episode_seeds

OVERRIDES = ["record.cameras=[]", "task.horizon=5"]
ACTION = np.linspace(-0.5, 0.5, 9)[:8]  # exact in float32, which the harness sends


@pytest.fixture(scope="module")
def tasks() -> Iterator[EvalTasks]:
    require_engine("mujoco")
    made = EvalTasks(["reach", "pick_cube"], engine="mujoco", overrides=OVERRIDES)
    yield made
    made.close()


def expected(episode: int) -> tuple[list[Any], list[float], int]:
    """Observations and rewards of an episode of `reach`, and its seed."""
    [seed] = episode_seeds("test", episode, 1)
    with anysim.make("reach", engine="mujoco", num_envs=1, overrides=OVERRIDES) as env:
        env.reset(seed=[seed])
        seen, rewards = [env.obs["policy"][0].astype(np.float32)], list[float]()
        while env.running[0]:
            rewards.append(float(env.step(ACTION[None]).reward[0]))
            seen.append(env.obs["policy"][0].astype(np.float32))
    return seen, rewards, seed


def test_an_episode_is_that_of_a_split(tasks: EvalTasks) -> None:
    seen, rewards, seed = expected(3)
    obs = tasks.reset("reach", 3)
    assert sorted(obs) == ["states", "task_description"]
    assert np.array_equal(obs["states"], seen[0])
    for k, reward in enumerate(rewards):
        stepped = tasks.step({"actions": ACTION[None] if k else ACTION})
        assert stepped.reward == reward
        assert np.array_equal(stepped.obs["states"], seen[k + 1])
        assert stepped.done == (k == len(rewards) - 1)
    assert tasks.result() == {"success": False, "status": "truncated", "seed": seed}
    assert tasks.seconds() == pytest.approx(5 * tasks.env.engine.world.physics.control_dt)
    assert tasks.horizon() == 5


def test_what_is_wrong_is_refused(tasks: EvalTasks) -> None:
    tasks.reset("reach", 0)
    for action in ({"actions": ACTION[1:]}, {"actions": np.full(8, np.nan)}, {"actions": np.zeros((2, 8))}):
        with pytest.raises(TaskError, match=r"'reach' takes \(8,\) finite numbers"):
            tasks.step(action)
    with pytest.raises(TaskError, match="a map with 'actions', got move"):
        tasks.step({"move": 1})
    with pytest.raises(TaskError, match=r"no task 'push' in this benchmark \(tasks: reach, pick_cube\)"):
        tasks.reset("push", 0)
    with pytest.raises(TaskError, match="--split nothing"):
        EvalTasks("reach", split="nothing")
    with pytest.raises(TaskError, match="at least one task"):
        EvalTasks([])


@pytest.mark.skipif(importlib.util.find_spec("vla_eval") is None, reason="needs vla-eval: make test-vla")
@pytest.mark.filterwarnings("ignore")  # those of the harness and what it imports
def test_its_own_harness_runs_episodes(tmp_path: Path) -> None:
    """A model server of theirs, their wire, their runner and their recording; images and states arrive."""
    import vla_eval.api  # pyright: ignore[reportMissingImports]
    from vla_eval.model_servers.predict import PredictModelServer  # pyright: ignore[reportMissingImports]

    asked: list[Any] = []

    class Leaning(PredictModelServer):
        def predict(self, obs: Any, ctx: Any) -> Any:
            asked.append(obs)
            return {"actions": ACTION}

    camera = "world.cameras.front.size=[32, 24]"
    params = {"tasks": ["reach"], "engine": "mujoco", "overrides": [*OVERRIDES, camera, "task.images={front: {}}"]}
    benchmark = {
        "benchmark": "anysim_adapters.vla_eval.benchmark:AnysimBenchmark",
        "episodes_per_task": 2,
        "params": params,
    }
    [told] = vla_eval.api.evaluate(Leaning(), {"benchmarks": [benchmark]}, output_dir=tmp_path, docker=False)
    [task] = told["tasks"]
    assert [one["metrics"]["success"] for one in task["episodes"]] == [False, False]
    assert [one["steps"] for one in task["episodes"]] == [5, 5]
    assert [one["metrics"]["seed"] for one in task["episodes"]] == episode_seeds("test", 0, 2)
    assert len(asked) == 10
    assert asked[0]["images"]["front"].shape == (24, 32, 3)
    seen, _, _ = expected(0)
    assert all(np.array_equal(obs["states"], wanted) for obs, wanted in zip(asked[:5], seen, strict=False))

"""Chunks of steps as RLinf takes them, against the same env stepped alone."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import TaskError
from anysim.testing.engines import require_engine
from anysim_adapters.rlinf import ChunkEnv

OVERRIDES = ["record.cameras=[]", "task.horizon=5"]


def local(num_envs: int = 3) -> Any:
    return anysim.make("reach", engine="mujoco", num_envs=num_envs, overrides=OVERRIDES)


@pytest.fixture(scope="module")
def made() -> Iterator[ChunkEnv]:
    require_engine("mujoco")
    chunks = ChunkEnv(local())
    yield chunks
    chunks.close()


def actions(steps: int) -> Any:
    return np.random.default_rng(1).uniform(-0.3, 0.3, (3, steps, 8))


def test_a_chunk_is_its_steps_and_its_ends_stand_last(made: ChunkEnv) -> None:
    obs, infos = made.reset(seed=4)
    assert set(obs) == {"policy", "task_descriptions"}
    assert infos["episode"]["episode_len"].tolist() == [0, 0, 0]
    given = actions(3)
    first = made.chunk_step(given)
    with local() as env:
        env.reset(seed=4)
        for k in range(3):
            result = env.step(given[:, k])
            assert np.array_equal(first.obs[k]["policy"], env.obs["policy"])
            assert np.array_equal(first.rewards[:, k], result.reward)
        assert not (first.terminations | first.truncations).any()
        second = made.chunk_step(given)  # the horizon comes in its second step
        last = [env.step(given[:, k]) for k in range(2)][-1]
        assert last.truncated.all()
        assert second.rewards.shape == second.truncations.shape == (3, 3)
        assert second.truncations[:, -1].all()
        assert not second.truncations[:, :-1].any()
        assert (second.rewards[:, 2] == 0).all()
        about = second.infos[-1]
        assert np.array_equal(about["final_observation"]["policy"], env.obs["policy"])
        assert about["_final_observation"].all()
        assert np.allclose(about["final_info"]["episode"]["return"], first.rewards.sum(1) + second.rewards.sum(1))
        assert about["episode"]["return"].tolist() == [0, 0, 0]
        env.reset()
        assert np.array_equal(second.obs[-1]["policy"], env.obs["policy"])


def test_some_envs_are_reset_alone(made: ChunkEnv) -> None:
    made.reset(seed=4)
    made.step(actions(1)[:, 0])
    before = made.env.obs["policy"].copy()
    obs, infos = made.reset(options={"env_idx": [1]})
    assert infos["elapsed_steps"].tolist() == [1, 0, 1]
    assert np.array_equal(obs["policy"][[0, 2]], before[[0, 2]])
    assert not np.array_equal(obs["policy"][1], before[1])


def test_envs_that_are_not_reset_wait(made: ChunkEnv) -> None:
    made.auto_reset = False
    try:
        made.reset(seed=2)
        ended = made.chunk_step(actions(6))
        assert np.flatnonzero(ended.truncations.any(axis=0)).tolist() == [4]  # where the horizon came
        assert "final_observation" not in ended.infos[-1]
        still = made.step(actions(1)[:, 0])
        assert not still.truncations.any()
        assert (still.rewards == 0).all()
        assert still.infos["elapsed_steps"].tolist() == [5, 5, 5]
    finally:
        made.auto_reset = True


def test_wrong_shapes_are_refused(made: ChunkEnv) -> None:
    made.reset(seed=1)
    for wrong in (np.zeros((3, 8)), np.zeros((3, 0, 8)), np.zeros((2, 4, 8)), np.zeros((3, 4, 7))):
        with pytest.raises(TaskError, match=r"chunk_actions are \(3, K, 8\)"):
            made.chunk_step(wrong)
    for wrong in ([3], [-1], [0.5]):
        with pytest.raises(TaskError, match="from 0 to 2"):
            made.reset(options={"env_idx": wrong})
    with pytest.raises(TaskError, match="option env_idx"):
        made.reset(options={"episode_id": [1]})

"""Gymnasium's own checker, and the vector view against SyncVectorEnv of single views."""

import warnings
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from anysim import registry
from anysim.errors import TaskError
from anysim.testing.engines import require_engine
from anysim_learning.gymnasium import GymEnv, GymVectorEnv
from tests.task.helpers import arm, blocks

N = 4


def test_check_env_passes() -> None:
    with arm(1, "task.horizon=20") as env, warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Box.*(infinity|unbounded).*")
        warnings.filterwarnings("ignore", message=".*not having any render modes.*|.*render_mode.*")
        warnings.filterwarnings("ignore", message=".*No render.*|.*spec.*")
        check_env(GymEnv(env), skip_render_check=True)


def test_a_single_view_needs_a_single_env() -> None:
    with blocks(2) as env, pytest.raises(TaskError, match="num_envs=1"):
        GymEnv(env)


def same(a: Any, b: Any) -> bool:
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, np.ndarray) and a.dtype == object:
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return bool(np.array_equal(a, b))


@pytest.mark.parametrize(
    "mode",
    [pytest.param(mode, marks=[pytest.mark.slow] if mode != AutoresetMode.NEXT_STEP else []) for mode in AutoresetMode],
)
def test_the_vector_view_equals_sync_vector_env(mode: AutoresetMode) -> None:
    def single() -> gym.Env:
        return GymEnv(arm(1, "task.horizon=9"))

    makers: list[Callable[[], gym.Env]] = [single] * N
    sync = SyncVectorEnv(makers, autoreset_mode=mode)
    native = GymVectorEnv(arm(N, "task.horizon=9"), mode)
    rng = np.random.default_rng(0)
    try:
        a: tuple[Any, ...] = sync.reset(seed=5)
        b: tuple[Any, ...] = native.reset(seed=5)
        assert same(a[0], b[0])
        assert same(a[1], b[1])
        ends = 0
        for t in range(60):
            if mode is AutoresetMode.DISABLED and t > 0:
                done = a[2] | a[3]
                # staggered ends: an extra reset of one env now and then
                if t % 4 == 0:
                    done = done | (np.arange(N) == (t // 4) % N)
                if done.any():
                    ends += int(done.sum())
                    a = sync.reset(options={"reset_mask": done.copy()})
                    b = native.reset(options={"reset_mask": done.copy()})
                    assert same(a[0], b[0])
                    assert same(a[1], b[1])
            action = rng.uniform(-1, 1, (N, 8)).astype(np.float32)
            a, b = sync.step(action), native.step(action)
            for left, right in zip(a, b, strict=True):
                assert same(left, right)
            ends += int((a[2] | a[3]).sum())
        assert ends > 10
    finally:
        sync.close()
        native.close()


def test_disabled_refuses_to_step_ended_envs() -> None:
    vector = GymVectorEnv(blocks(2, "task.horizon=1"), AutoresetMode.DISABLED)
    vector.reset(seed=0)
    vector.step(np.zeros((2, 0)))
    with pytest.raises(TaskError, match="reset_mask"):
        vector.step(np.zeros((2, 0)))
    vector.close()


def test_named_actions_check_and_step_as_the_flat_ones() -> None:
    with arm(1, "task.horizon=20") as env, warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Box.*(infinity|unbounded).*")
        warnings.filterwarnings("ignore", message=".*not having any render modes.*|.*render_mode.*")
        warnings.filterwarnings("ignore", message=".*No render.*|.*spec.*|.*dictionary.*")
        check_env(GymEnv(env, action="named"), skip_render_check=True)
    flat, named = GymVectorEnv(arm(3, "task.horizon=9")), GymVectorEnv(arm(3, "task.horizon=9"), action="named")
    try:
        assert isinstance(named.single_action_space, gym.spaces.Dict)
        assert list(named.single_action_space) == ["panda.arm", "panda.eef"]
        named.action_space.seed(0)
        assert same(dict(enumerate(flat.reset(seed=1))), dict(enumerate(named.reset(seed=1))))
        for _ in range(12):
            action = named.action_space.sample()
            whole = np.concatenate([action["panda.arm"], action["panda.eef"]], axis=1)
            assert same(dict(enumerate(flat.step(whole))), dict(enumerate(named.step(action))))
    finally:
        flat.close()
        named.close()


def test_an_unknown_form_of_action_is_refused() -> None:
    with arm(1) as env, pytest.raises(TaskError, match="'flat' or 'named', got 'names'"):
        GymEnv(env, action="names")  # type: ignore[arg-type]


# ------------------------------------------------------------------ installed tasks by name


def checked(task: str, engine: str = "mujoco") -> None:
    """Gymnasium's checker on a task by its name, and a vector env of it."""
    require_engine(engine)
    blind = ["record.cameras=[]"]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Box.*(infinity|unbounded).*")
        warnings.filterwarnings("ignore", message=".*not having any render modes.*|.*render_mode.*")
        # advice: bases are driven in m/s, and hands by joint positions
        warnings.filterwarnings("ignore", message=".*we recommend using a symmetric and normalized space.*")
        single = gym.make(f"anysim_learning.envs:anysim/{task}-v0", engine=engine, overrides=blind)
        check_env(single.unwrapped, skip_render_check=True)
        assert "privileged" not in single.observation_space.spaces
        single.close()
    many = gym.make_vec(f"anysim/{task}-v0", num_envs=2, engine=engine, overrides=blind, autoreset_mode="SameStep")
    obs, info = many.reset(seed=3)
    assert many.observation_space.contains(obs)
    assert info["episode_seed"].shape == (2,)
    obs, reward, *_ = many.step(many.action_space.sample())
    assert np.isfinite(reward).all()
    many.close()


def test_a_task_is_made_by_its_name() -> None:
    checked("push_cube")
    shown = gym.make("anysim/push_cube-v0", engine="mujoco", privileged=True)
    assert "privileged" in shown.reset(seed=0)[0]
    shown.close()


@pytest.mark.slow
@pytest.mark.parametrize("task", [name for name in registry.names("tasks") if name != "push_cube"])
def test_every_task_is_made_by_its_name(task: str) -> None:
    checked(task)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
@pytest.mark.parametrize("task", ["push_cube", "open_drawer", "dex_reach_tips", "stand_still", "nav_to_pose"])
def test_tasks_of_each_family_are_made_on_the_other_engines(task: str, engine: str) -> None:
    checked(task, engine)

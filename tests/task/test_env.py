"""The MDP contract of TaskEnv."""

import numpy as np
import pytest

import anysim
from anysim import hooks
from anysim.errors import SpecError, TaskError
from anysim.task.contract import Status
from anysim.testing.engines import require_engine
from tests.task.helpers import arm, blocks

NOTHING = np.zeros((1, 0))


def no_action(n: int) -> np.ndarray:
    return np.zeros((n, 0))


def test_step_before_reset_is_refused() -> None:
    with blocks(2) as env, pytest.raises(TaskError, match=r"not reset yet.*call reset"):
        env.step(no_action(2))


def test_horizon_truncates_and_an_ended_env_is_refused() -> None:
    with blocks(2) as env:
        env.reset(seed=0)
        for _ in range(7):
            assert (env.step(no_action(2)).status == "running").all()
        result = env.step(no_action(2))
        assert result.truncated.all()
        assert not result.terminated.any()
        with pytest.raises(TaskError, match=r"envs \{0: 'truncated', 1: 'truncated'\} cannot be stepped"):
            env.step(no_action(2))


def test_success_comes_before_truncation_and_failure_is_failed() -> None:
    with blocks(3, "task.horizon=1") as env:
        env.reset(seed=0)
        red = env.engine.index.body("red")
        pose = env.engine.get_state().body_pose[:, red].copy()
        pose[0, :3] = env.scene.goals["goal"][0, :3]
        pose[1, 2] = 0.0
        env.engine.set_body_state(pose[:, None], bodies=[red])
        result = env.step(no_action(3))
        assert result.status.tolist() == [Status.SUCCESS, Status.FAILED, Status.TRUNCATED]
        assert result.info["is_success"].tolist() == [True, False, False]


def test_success_must_hold() -> None:
    with blocks(1, "task.hold=3") as env:
        env.reset(seed=0)
        red = env.engine.index.body("red")
        pose = env.engine.get_state().body_pose[:, red].copy()
        pose[0, :3] = env.scene.goals["goal"][0, :3]
        env.engine.set_body_state(pose[:, None], bodies=[red])
        words = [str(env.step(NOTHING).status[0]) for _ in range(3)]
        assert words == ["running", "running", "success"]


def test_continuing_after_success_reports_it_without_ending() -> None:
    with blocks(1, "task.on_success=continue") as env:
        env.reset(seed=0)
        red = env.engine.index.body("red")
        pose = env.engine.get_state().body_pose[:, red].copy()
        pose[0, :3] = env.scene.goals["goal"][0, :3]
        env.engine.set_body_state(pose[:, None], bodies=[red])
        result = env.step(NOTHING)
        assert result.status[0] == "running"
        assert result.info["is_success"][0]


def test_a_mask_steps_and_resets_only_its_rows() -> None:
    with blocks(3) as env:
        env.reset(seed=0)
        before = env.obs
        result = env.step(no_action(3), np.array([True, False, True]))
        assert result.info["elapsed_steps"].tolist() == [1, 0, 1]
        assert result.reward[1] == 0.0
        env.reset(mask=np.array([False, False, True]))
        after = env.obs
        assert (after["policy"][:2] == before["policy"][:2]).all()
        assert (after["policy"][2] != before["policy"][2]).any()


def test_ended_hold_leaves_ended_envs_alone() -> None:
    with blocks(2, "task.ended=hold") as env:
        env.reset(seed=0)
        env.step(no_action(2), np.array([True, False]))
        for _ in range(7):
            env.step(no_action(2))
        assert env.status.tolist() == ["truncated", "running"]
        held = env.obs["policy"][0].copy()
        result = env.step(no_action(2))
        assert result.status.tolist() == ["truncated", "truncated"]
        assert (result.obs["policy"][0] == held).all()
        assert result.info["elapsed_steps"].tolist() == [8, 8]


def test_results_are_fresh_arrays() -> None:
    with blocks(2) as env:
        first, _ = env.reset(seed=0)
        first["policy"][:] = 7.0
        a = env.step(no_action(2))
        kept = {k: v.copy() for k, v in a.obs.items()}
        a.obs["policy"][:] = 7.0
        assert (env.obs["policy"] == kept["policy"]).all()
        status, reward = a.status.copy(), a.reward.copy()
        env.step(no_action(2))
        assert (a.status == status).all()
        assert (a.reward == reward).all()


def test_env_i_does_not_depend_on_the_number_of_envs() -> None:
    with blocks(2) as few, blocks(5) as many:
        a, _ = few.reset(seed=11)
        b, _ = many.reset(seed=11)
        assert (a["policy"] == b["policy"][:2]).all()
        few.reset(mask=np.array([False, True]))
        many.reset(mask=np.array([True, True, False, False, True]))
        assert (few.obs["policy"][1] == many.obs["policy"][1]).all()


def test_an_episode_is_drawn_again_from_its_seed() -> None:
    with blocks(2) as env:
        obs, info = env.reset(seed=3)
        env.reset()
        again, _ = env.reset(episode_seeds=info["episode_seed"])
        assert (again["policy"] == obs["policy"]).all()


@pytest.mark.parametrize(("engine", "n"), [("null", 1), ("null", 3), ("mujoco", 2), ("pybullet", 2), ("sapien", 2)])
def test_continuing_from_a_snapshot_equals_the_uninterrupted_run(engine: str, n: int) -> None:
    require_engine(engine)
    rng = np.random.default_rng(0)
    with arm(n, engine=engine) as env:
        env.reset(seed=1)
        actions = rng.uniform(-1, 1, (20, n, env.action_dim))
        for action in actions[:10]:
            env.step(action)
        snapshot = env.snapshot()
        direct = [env.step(action) for action in actions[10:]]
        env.reset(seed=9)
        env.reset_to(snapshot)
        again = [env.step(action) for action in actions[10:]]
        for a, b in zip(direct, again, strict=True):
            assert all((a.obs[g] == b.obs[g]).all() for g in a.obs)
            assert (a.reward == b.reward).all()
            assert (a.status == b.status).all()
        env.reset_to(snapshot)
        after_a, _ = env.reset()
        env.reset_to(snapshot)
        after_b, _ = env.reset()
        assert (after_a["policy"] == after_b["policy"]).all(), "the seeds of later episodes are part of a snapshot"


def test_snapshot_rows_can_go_to_other_envs() -> None:
    with blocks(3) as env:
        env.reset(seed=1)
        snapshot = env.snapshot(np.array([True, False, False]))
        env.reset_to(snapshot, [2])
        assert (env.obs["policy"][2] == env.obs["policy"][0]).all()
        assert (env.obs["policy"][1] != env.obs["policy"][0]).any()


def test_actions_are_clipped_and_checked() -> None:
    with arm(2) as env:
        env.reset(seed=0)
        env.step(np.full((2, env.action_dim), 9.0))
        assert np.abs(env.scene.last_action).max() == 1.0
        with pytest.raises(TaskError, match=r"must have shape \(2, 8\), got \(8,\)"):
            env.step(np.zeros(8))
        with pytest.raises(TaskError, match="not a number"):
            env.step(np.full((2, 8), np.nan))


def test_order_within_a_step_and_hooks() -> None:
    seen: list[str] = []

    class Watcher:
        @hooks.hookimpl
        def before_episode(self, env_ids: np.ndarray) -> None:
            seen.append(f"begin {env_ids.tolist()}")

        @hooks.hookimpl
        def after_step(self, env: object, result: object) -> None:
            seen.append(f"step {result.status.tolist()}")

        @hooks.hookimpl
        def after_episode(self, env_ids: np.ndarray) -> None:
            seen.append(f"end {env_ids.tolist()}")

    watcher = Watcher()
    hooks.manager().register(watcher)
    try:
        with blocks(1, "task.horizon=2") as env:
            env.reset(seed=0)
            env.step(NOTHING)
            env.step(NOTHING)
    finally:
        hooks.manager().unregister(watcher)
    assert seen == ["begin [0]", "step ['running']", "step ['truncated']", "end [0]"]


def test_a_term_that_names_nothing_is_refused_with_what_exists() -> None:
    with pytest.raises(SpecError) as caught:
        blocks(1, "task.rewards.close.a=redd")
    text = str(caught.value)
    assert "task.rewards.close.a" in text
    assert "did you mean 'red'" in text


def test_several_bad_names_are_reported_at_once() -> None:
    with pytest.raises(SpecError) as caught:
        blocks(1, "task.rewards.close.a=redd", "task.failure.fell.frame=tabel")
    assert len(caught.value.issues) == 2


def test_the_environment_variable_names_the_engine_unless_the_file_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ANYSIM_ENGINE", "null")
    assert anysim.load("pick_cube").spec.engine.name == "null"
    assert anysim.load({"engine": "mujoco"}).spec.engine.name == "mujoco"
    monkeypatch.delenv("ANYSIM_ENGINE")
    assert anysim.load("pick_cube").spec.engine.name == "mujoco"


def test_the_rows_of_a_snapshot_are_looked_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    with blocks(2) as env:
        env.reset(seed=0)
        snapshot, looked = env.snapshot(), []
        refuse = type(env.engine).refuse_snapshot
        monkeypatch.setattr(
            type(env.engine), "refuse_snapshot", lambda *words: looked.append(refuse(*words)), raising=True
        )
        env.reset_to(snapshot)
        assert len(looked) == 1
        env.engine.restore(snapshot.engine)
        assert len(looked) == 2

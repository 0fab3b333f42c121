"""The pick skill on the real engine: it succeeds, acts only through actions, and types its failures."""

import gc
import weakref

import numpy as np
import pytest

from anysim import load, make, registry
from anysim.errors import SpecError
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.contract import Status
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from tests.task.helpers import arm


def rollout(env: TaskEnv, policy: SkillPolicy, steps: int) -> list[str]:
    """Run until all envs have ended or the skill gave up; the words at the end."""
    everyone = np.arange(env.num_envs)
    policy.begin(everyone)
    for _ in range(steps):
        active = env.running & ~policy.gave_up(everyone)
        if not active.any():
            break
        env.step(policy.act(np.flatnonzero(active)), active)
    return env.status.tolist()


@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_it_lifts_the_cube_to_the_goal_in_every_env_on_every_engine(engine: str) -> None:
    require_engine(engine)
    with arm(3, engine=engine) as env:
        env.reset(seed=1)
        assert rollout(env, SkillPolicy(env), 400) == [Status.SUCCESS] * 3
        cube = env.engine.get_state().body_pose[:, env.engine.index.body("cube"), :3]
        assert (np.linalg.norm(cube - env.scene.goals["goal"][:, :3], axis=1) <= 0.025).all()


def test_it_never_writes_state() -> None:
    """All it does goes through actions: replaying them without the skill gives the same states."""
    with arm(1, engine="mujoco") as env:
        policy = SkillPolicy(env)
        env.reset(seed=5)
        policy.begin(np.array([0]))
        actions = []
        for _ in range(60):
            actions.append(policy.act(np.array([0])))
            env.step(actions[-1])
        wanted = env.engine.get_state().joint_pos.copy()
        env.reset(seed=5)
        for action in actions:
            env.step(action)
        assert (env.engine.get_state().joint_pos == wanted).all()


def test_a_cube_out_of_reach_is_no_ik() -> None:
    with arm(1, "world.layout.cube.x=0.84", "world.layout.cube.y=0.68", engine="mujoco") as env:
        env.reset(seed=0)
        policy = SkillPolicy(env)
        rollout(env, policy, 300)
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.NO_IK
        assert policy.describe(0)["outcome"] == "no_ik"
        assert policy.describe(0)["ladder"] == ["no_ik -> back_off", "no_ik -> recover", "no_ik -> give up"]


def test_a_cube_that_is_taken_away_is_tried_again_and_given_up() -> None:
    with arm(1, "task.horizon=2000", engine="mujoco") as env:
        env.reset(seed=1)
        policy = SkillPolicy(env)
        policy.begin(np.array([0]))
        cube = env.engine.index.body("cube")
        home = env.engine.get_state().body_pose[:, cube].copy()
        for _ in range(1500):
            if policy.gave_up(np.array([0]))[0]:
                break
            env.step(policy.act(np.array([0])))
            if policy.describe(0)["phase"] == "bring: carry":
                env.engine.set_body_state(home[:, None], np.zeros((1, 1, 6)), bodies=[cube])
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.UNSTABLE_GRASP
        assert policy.skill.attempts[0] == 3


def test_envs_do_not_disturb_each_other() -> None:
    finals = []
    for n in (1, 3):
        with arm(n, engine="mujoco") as env:
            env.reset(seed=2)
            rollout(env, SkillPolicy(env), 400)
            finals.append(env.engine.get_state().joint_pos[0].copy())
    assert (finals[0] == finals[1]).all()


def test_a_task_without_an_expert_says_so() -> None:
    from anysim.errors import TaskError
    from tests.task.helpers import blocks

    with blocks(1) as env, pytest.raises(TaskError, match=r"has no expert; add task\.expert"):
        SkillPolicy(env)


def test_where_it_is_not_installed_the_error_names_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    installed = registry._entries
    monkeypatch.setattr(registry, "_entries", lambda kind: {} if kind == "skills" else installed(kind))
    remedy = (
        r"skill: no skill named 'pick' is installed; it comes with the package anysim-skills: pip install anysim-skill"
    )
    with pytest.raises(SpecError, match=remedy):
        load("pick_cube")


def test_what_skills_share_in_an_env_goes_with_it() -> None:
    env = make("pick_cube", engine="mujoco", num_envs=1)
    policy = SkillPolicy(env)
    shared = weakref.ref(policy.skill.movers[0])  # type: ignore[attr-defined]
    env.close()
    del policy, env
    gc.collect()
    assert shared() is None

"""Push by model predictive control: motions are tried out on MuJoCo, whatever engine carries them out."""

from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.conventions import Array
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from tests.plugins.skills.test_pick import rollout

WORLD = Path(__file__).parent / "worlds/push.yaml"
STROKE = 3


def pushing(engine: str, num_envs: int, *overrides: str) -> TaskEnv:
    require_engine("mujoco")
    require_engine(engine)
    return make(WORLD, engine=engine, num_envs=num_envs, overrides=["task.expert.backend=mpc", *overrides])


def stroke(env: TaskEnv, steps: int) -> Array:
    """(steps, A) the actions of the first env from the beginning of its stroke on."""
    env.reset(seed=11)
    policy, everyone = SkillPolicy(env), np.arange(env.num_envs)
    policy.begin(everyone)
    actions: list[Array] = []
    while len(actions) < steps:
        action = policy.act(everyone)
        if policy.skill.phase[0] == STROKE:
            actions.append(action[0].copy())
        env.step(action)
    return np.array(actions)


@pytest.mark.slow
def test_the_cube_is_pushed_to_the_goal() -> None:
    with pushing("mujoco", 1) as env:
        env.reset(seed=11)
        assert rollout(env, SkillPolicy(env), 400) == ["success"]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_the_cube_is_pushed_to_the_goal_on_another_engine_than_the_plan_is_made_on(engine: str) -> None:
    with pushing(engine, 3) as env:
        env.reset(seed=11)
        assert rollout(env, SkillPolicy(env), 500).count("success") >= 2


def test_a_plan_changes_nothing_in_the_env() -> None:
    with pushing("mujoco", 1, "task.expert.samples=6") as env:
        env.reset(seed=11)
        policy, one = SkillPolicy(env), np.array([0])
        policy.begin(one)
        while policy.skill.phase[0] < STROKE:
            env.step(policy.act(one))
        before = env.engine.world_state().to_json()
        policy.act(one)
        assert env.engine.world_state().to_json() == before


@pytest.mark.slow
def test_plans_depend_on_the_episode_alone() -> None:
    """Not on how many envs there are, nor on an earlier run; and they are not the straight stroke."""
    found: list[Array] = []
    for count, backend in ((1, "mpc"), (1, "mpc"), (2, "mpc"), (1, "planner")):
        with pushing("mujoco", count, f"task.expert.backend={backend}") as env:
            found.append(stroke(env, 25))
    assert (found[0] == found[1]).all()
    assert (found[0] == found[2]).all()
    assert not np.allclose(found[0], found[3])

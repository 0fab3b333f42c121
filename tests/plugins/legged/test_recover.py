"""The skill `recover`: which legs push and when, and a dog that gets onto its feet from its back and its sides."""

import numpy as np
import pytest

from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.skills.runner import SkillPolicy, bind_skill
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from tests.plugins.skills.test_pick import rollout
from tests.tasks.states import blind, put, seen

TURNS = [
    {"left": {"*_calf_joint": -2.05}, "right": {"*_calf_joint": -2.05}, "pushes": 0.04, "folds": 0.02},
    {"left": {"*L_thigh_joint": 3.0}, "right": {"*R_thigh_joint": 3.0}, "pushes": 0.06, "folds": 0.04},
]
WORDS = {"robot": "dog", "posture": {"*_thigh_joint": 0.8}, "turns": TURNS}
EXPERT = {"skill": "recover", "waits": 0.04, "rises": 0.1, **WORDS}


def lying(env: TaskEnv, *rolls: float) -> None:
    pose = seen(env, "dog")
    pose[:, 3:] = P.from_roll_pitch_yaw(np.array([[roll, 0.0, 0.4] for roll in rolls]))
    put(env, "dog", pose)


def acted(env: TaskEnv, policy: SkillPolicy, steps: int) -> np.ndarray:
    """(steps, N, 4) the thighs' targets from the home [rad]."""
    return np.array([0.3 * policy.act(np.arange(env.num_envs))[:, 1::3] for _ in range(steps)])


def test_the_legs_of_the_lower_side_push_and_fold_until_it_is_level() -> None:
    with blind("get_up", "null", 3, f"task.expert={EXPERT}") as env:
        env.reset(seed=2)
        policy = SkillPolicy(env)
        policy.begin(np.arange(3))
        lying(env, -2.0, 2.0, 0.1)
        told = acted(env, policy, 7)
        left, right = np.array([1.7, 0.0, 1.7, 0.0]), np.array([0.0, 1.7, 0.0, 1.7])
        assert (told[:2] == 0.0).all(), "it comes to lie"
        np.testing.assert_allclose(told[2:5, 0], np.tile(left, (3, 1)), atol=1e-9)
        np.testing.assert_allclose(told[2:5, 1], np.tile(right, (3, 1)), atol=1e-9)
        assert (told[5:7, :2] == 0.0).all(), "it folds them"
        np.testing.assert_allclose(told[2:7, 2, 0], -0.5 * np.arange(1, 6) / 5, atol=1e-9)
        assert policy.describe(0)["phase"] == "turn"
        lying(env, 0.0, -2.0, 0.0)
        told = acted(env, policy, 6)
        np.testing.assert_allclose(told[:5, 0, 0], -0.5 * np.arange(1, 6) / 5, atol=1e-9)
        np.testing.assert_allclose(told[:3, 1], np.tile(left, (3, 1)), atol=1e-9)
        assert [policy.describe(env)["phase"] for env in range(3)] == ["stand", "turn", "stand"]


def test_what_takes_no_joint_positions_is_refused() -> None:
    with (
        blind("stand_still", "null", 1, "world.robots.dog.actions.base=trot") as env,
        pytest.raises(TaskError, match=r"recover commands joint positions, which 'dog\.base' does not take"),
    ):
        bind_skill("recover", WORDS, env, "task.expert")


def test_on_its_back_it_tries_one_turn_after_the_other() -> None:
    with blind("get_up", "null", 1, f"task.expert={EXPERT}") as env:
        env.reset(seed=2)
        policy = SkillPolicy(env)
        policy.begin(np.arange(1))
        lying(env, 3.0)
        told = np.array([0.3 * policy.act(np.arange(1))[0, :6] for _ in range(13)])  # of its front legs
        thighs, calves = told[2:, 1::3], told[2:, 2::3]
        both, right, home = [0.6, 0.6], [0.0, 1.7], [0.0, 0.0]
        np.testing.assert_allclose(calves, [both] * 2 + [home] * 6 + [both] * 2 + [home], atol=1e-9)
        np.testing.assert_allclose(thighs, [home] * 3 + [right] * 3 + [home] * 5, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_a_dog_gets_up_from_its_back_and_its_sides(engine: str) -> None:
    require_engine(engine)
    rolls = "task.events.tip.roll={range: [1.5, 4.7]}"
    with blind("get_up", engine, 6, "level=L2", rolls) as env:
        assert env.spec.task is not None
        env.reset(seed=3)
        words = rollout(env, SkillPolicy(env), env.spec.task.horizon)
    assert words.count("success") >= 5, words

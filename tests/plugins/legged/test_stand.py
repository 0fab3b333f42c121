"""The skill `stand`: what it asks of each kind of controller, and what it says of a robot that has fallen."""

import numpy as np
import pytest

from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy, bind_skill
from anysim.testing.engines import require_engine
from tests.tasks.states import blind, put, seen

BOTH = np.arange(2)


@pytest.mark.parametrize("controller", ["joint_position", "trot"])
def test_a_dog_stands_by_either_controller(controller: str) -> None:
    require_engine("mujoco")
    with blind("stand_still", "mujoco", 2, f"world.robots.dog.actions.base={controller}") as env:
        env.reset(seed=2)
        policy = SkillPolicy(env)
        policy.begin(BOTH)
        for _ in range(60):
            env.step(policy.act(BOTH))
        assert env.status.tolist() == ["running"] * 2
        assert (np.abs(seen(env, "dog")[:, 2] - 0.31) < 0.02).all()
        assert (policy.skill.outcome == OUTCOMES.index(Outcome.RUNNING)).all()


def test_a_dog_on_its_side_is_lost_in_its_env_alone() -> None:
    with blind("stand_still", "null") as env:
        env.reset(seed=2)
        policy = SkillPolicy(env)
        policy.begin(BOTH)
        pose = seen(env, "dog")
        pose[1, 3:] = P.from_roll_pitch_yaw(np.array([1.2, 0.0, 0.0]))
        put(env, "dog", pose)
        policy.act(BOTH)
        assert policy.gave_up(BOTH).tolist() == [False, True]
        assert policy.describe(1)["outcome"] == "lost"


def test_it_rises_to_a_posture_along_a_line() -> None:
    with blind("get_up", "null", 1) as env:
        env.reset(seed=2)
        rising = {"robot": "dog", "posture": {"*_thigh_joint": 0.8, "*_calf_joint": -1.6}}
        skill = bind_skill("stand", rising, env, "task.expert")
        skill.begin(np.arange(1))
        first, half, last = (np.zeros((1, env.action_dim)) for _ in range(3))
        for elapsed, action in ((0, first), (24, half), (80, last)):
            env.scene.elapsed[:] = elapsed
            skill.act(np.arange(1), action)
        wanted = np.tile([0.0, (0.8 - 1.3) / 0.3, (-1.6 + 2.65) / 0.3], 4)
        np.testing.assert_allclose(last[0], wanted, atol=1e-9)
        np.testing.assert_allclose(half[0], 0.5 * wanted, atol=1e-9)
        np.testing.assert_allclose(first[0], wanted / 50, atol=1e-9)
        with pytest.raises(TaskError, match=r"posture: no joint of 'dog' matches '\*_knee'"):
            bind_skill("stand", {"robot": "dog", "posture": {"*_knee": 0.0}}, env, "task.expert")


def test_a_robot_without_a_controller_is_refused() -> None:
    other = "world.robots.other={robot: unitree_a1, position: [2.0, 0.0, 0.0]}"
    seen_of_one = "task.observations={policy: [{term: projected_gravity, robot: dog}]}"
    with (
        blind("stand_still", "null", 1, other, seen_of_one) as env,
        pytest.raises(TaskError, match=r"no channel of 'other' has a controller; add world\.robots\.other\.actions"),
    ):
        bind_skill("stand", {"robot": "other"}, env, "task.expert")

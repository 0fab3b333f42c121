"""The skill `trot`: the gait through drives that take positions alone."""

import numpy as np
import pytest

from anysim.errors import TaskError
from anysim.skills.runner import SkillPolicy, bind_skill
from anysim.testing.engines import require_engine
from tests.tasks.states import blind

FORWARD = (
    "level=L0",
    "task.command.walk={term: tasks.velocity, forward: 0.4, left: 0.1, turn: 0.3, still: 0.0, straight: 0.0}",
)


@pytest.mark.parametrize("robot", ["unitree_go1", "unitree_go2", "anymal_c", "solo12", "unitree_b1"])
def test_soft_legs_walk_as_they_are_told(robot: str) -> None:
    require_engine("mujoco")
    with blind("go1_velocity", "mujoco", 1, *FORWARD, robot=robot) as env:
        env.reset(seed=2)
        policy = SkillPolicy(env)
        policy.begin(np.arange(1))
        told, seen = env.scene.goals["walk"][0], []
        for _ in range(150):
            seen.append(env.step(policy.act(np.arange(1))).obs["policy"][0, [0, 1, 5]])
        assert env.status.tolist() == ["running"]
        assert np.abs(np.mean(seen[75:], axis=0) - told).max() < 0.06


def test_what_it_cannot_command_is_refused() -> None:
    with (
        blind("walk_to_pose", "null", 1) as env,
        pytest.raises(TaskError, match=r"no commanded velocity 'goal'; task\.command has none"),
    ):
        bind_skill("trot", {"robot": "dog", "goal": "goal"}, env, "task.expert")
    with (
        blind("go1_velocity", "null", 1, "world.robots.dog.actions.base=trot", "task.expert=null") as env,
        pytest.raises(TaskError, match=r"the skill trot commands joint positions, which 'dog\.base' does not take"),
    ):
        bind_skill("trot", {"robot": "dog", "goal": "walk"}, env, "task.expert")

"""The skill dex_turn: one finger turns spokes either way, and a hand without that finger is told."""

import numpy as np
import pytest

from anysim import make
from anysim.errors import AnysimError
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from tests.tasks.states import blinding

TASK = "rotate_valve"
STILL = blinding(TASK)


def test_spokes_are_turned_clockwise_with_the_other_fingers_bent() -> None:
    require_engine("mujoco")
    turn = ("task.success=null", "task.expert.angle=-1.7")
    with make(TASK, engine="mujoco", num_envs=2, overrides=[*STILL, *turn]) as env:
        env.reset(seed=3)
        policy = SkillPolicy(env)
        policy.begin(np.arange(2))
        bent = []
        for _ in range(260):
            env.step(policy.act(np.arange(2)))
            bent.append(env.engine.get_state().joint_pos[:, env.engine.index.joint("robot.hand_joint_5.0")])
        wheel = env.engine.get_state().joint_pos[:, env.engine.index.joint("valve.wheel")]
    assert wheel == pytest.approx([-1.7, -1.7], abs=0.15)
    assert (np.array(bent[60:]) > 1.0).all()


def test_a_finger_that_the_hand_does_not_have_is_told() -> None:
    with (
        make(TASK, engine="null", overrides=[*STILL, "task.expert.finger=indx"]) as env,
        pytest.raises(AnysimError, match=r"no finger 'indx'.*'index'.*it has: index, middle, ring, thumb"),
    ):
        SkillPolicy(env)

"""The skill take_hold on a drawer: the hand closes on its handle and stays there, and the drawer where it is."""

import numpy as np
import pytest

from anysim import make
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from tests.plugins.skills.test_manipulation import WORLDS

EXPERT = "task.expert={skill: take_hold, robot: panda, part: cabinet.drawer_1}"
ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]


@pytest.mark.parametrize("engine", ENGINES)
def test_the_hand_closes_on_a_handle_and_keeps_hold_of_it(engine: str) -> None:
    require_engine(engine)
    with make(WORLDS / "open_drawer.yaml", engine=engine, num_envs=2, overrides=["task.expert=null", EXPERT]) as env:
        env.reset(seed=4)
        policy, both = SkillPolicy(env), np.arange(2)
        policy.begin(both)
        for _ in range(250):
            env.step(policy.act(both))
        assert [OUTCOMES[code] for code in policy.skill.outcome] == [Outcome.OK] * 2
        env.scene.look(None)
        tool, handle = env.scene.frame("panda.tool"), env.scene.frame("cabinet.drawer_1.handle")
        assert (P.norm(tool.position - handle.position) < 0.02).all()
        state, index = env.engine.get_state(), env.engine.index
        fingers = state.joint_pos[:, index.robot("panda").channels["eef"].joints]
        assert np.allclose(fingers, 0.008, atol=0.002)  # the radius of the bar is between them
        assert (state.joint_pos[:, index.joint("cabinet.drawer_1")] < 0.02).all()


def test_a_handle_out_of_reach_is_said() -> None:
    far = "world.layout.cabinet.x=2.0"
    table = "world.objects.table.source.box=[4.0,1.4,0.4]"
    with make(WORLDS / "open_drawer.yaml", engine="mujoco", overrides=["task.expert=null", EXPERT, far, table]) as env:
        env.reset(seed=4)
        policy, one = SkillPolicy(env), np.arange(1)
        policy.begin(one)
        for _ in range(1000):
            if policy.gave_up(one)[0]:
                break
            env.step(policy.act(one))
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.NO_IK

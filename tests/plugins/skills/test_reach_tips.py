"""Finger tips are brought to goals of their own, each by the joints of its finger."""

import numpy as np
import pytest

from anysim.errors import SpecError
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.scene import RobotView
from anysim.testing.engines import require_engine
from anysim_skills.moving.reach_tips import ReachTips
from tests.plugins.skills.test_pick import rollout
from tests.tasks.states import blind

TASK = "dex_reach_tips"


@pytest.fixture(autouse=True)
def _needs_mujoco() -> None:
    require_engine("mujoco")


def test_fingers_without_a_goal_stay() -> None:
    """Index and thumb go to their goals to half a centimetre; the others do not stir."""
    with blind(TASK, "mujoco", 3, "task.on_success=continue") as env:
        env.reset(seed=3)
        ids, goals = np.arange(3), {"index_tip": "index", "thumb_tip": "thumb"}
        skill = ReachTips(env, robot=RobotView(env.scene, "hand"), goals=goals)
        skill.begin(ids)
        joints = skill.hand.joints
        before = env.engine.get_state().joint_pos[:, joints].copy()
        for _ in range(80):
            action = np.zeros((3, env.action_dim))
            skill.act(ids, action)
            env.step(action)
        assert (skill.outcome == OUTCOMES.index(Outcome.OK)).all()
        env.scene.look(None)
        for tip in ("index", "thumb"):
            away = env.scene.frame(tip).position - env.scene.frame(f"hand.{tip}_tip").position
            assert (np.linalg.norm(away, axis=1) < 0.005).all()
        moved = np.abs(env.engine.get_state().joint_pos[:, joints] - before)
    assert (moved[:, 4:12] < 0.01).all()
    assert (moved[:, :4].max(axis=1) > 0.1).all()


def test_a_goal_behind_the_palm_is_no_ik() -> None:
    with blind(TASK, "mujoco", 1, "task.command.ring.offset=[-0.15, -0.05, 0.0]") as env:
        env.reset(seed=3)
        policy = SkillPolicy(env)
        rollout(env, policy, 40)
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.NO_IK


@pytest.mark.parametrize(("goals", "said"), [({"pinky_tip": "index"}, "pinky_tip"), ({"index_tip": "there"}, "there")])
def test_a_tip_or_goal_that_is_not_there_is_named(goals: dict[str, str], said: str) -> None:
    with blind(TASK, "mujoco", 1) as env, pytest.raises(SpecError, match=said):
        ReachTips(env, robot=RobotView(env.scene, "hand"), goals=goals)

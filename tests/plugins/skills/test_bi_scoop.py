"""The skill bi_scoop: a tray stays level on two hands, and one out of reach of a hand is told of."""

import numpy as np

from anysim import make
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from tests.plugins.skills.test_pick import rollout
from tests.tasks.states import blinding

TASK = "bi_dex_lift"


def test_a_tray_rises_level_on_open_hands_that_keep_to_their_ends() -> None:
    require_engine("mujoco")
    with make(TASK, engine="mujoco", num_envs=2, overrides=blinding(TASK)) as env:
        env.reset(seed=6)
        before = env.scene.frame("tray").position[:, 2].copy()
        assert rollout(env, SkillPolicy(env), 400) == ["success"] * 2
        env.scene.look(None)
        tray, hands = env.scene.frame("tray"), [env.scene.frame(f"{who}.tool") for who in ("robot", "partner")]
        assert (tray.position[:, 2] - before > 0.1).all()
        assert (hands[0].position[:, 0] < tray.position[:, 0] - 0.17).all()
        assert (hands[1].position[:, 0] > tray.position[:, 0] + 0.17).all()


def test_a_tray_out_of_reach_of_one_hand_is_told() -> None:
    require_engine("mujoco")
    away = "world.robots.partner.position=[2.5,0,0]"
    with make(TASK, engine="mujoco", num_envs=1, overrides=[*blinding(TASK), away]) as env:
        env.reset(seed=6)
        policy = SkillPolicy(env)
        rollout(env, policy, 400)
        assert policy.gave_up(np.arange(1)).all()
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.NO_IK

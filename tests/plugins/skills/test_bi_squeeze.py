"""The skills bi_squeeze and bi_place: two arms of one channel carry a box between their palms."""

import numpy as np

from anysim import make
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.references import ContactView
from anysim.testing.engines import require_engine
from tests.tasks.states import blinding

TASK = "g1_transport_box"


def test_palms_press_a_box_while_it_is_carried_and_let_go_of_it_at_once() -> None:
    require_engine("mujoco")
    with make(TASK, engine="mujoco", num_envs=2, overrides=[*blinding(TASK), "task.on_success=continue"]) as env:
        env.reset(seed=6)
        policy, everyone = SkillPolicy(env), np.arange(2)
        policy.begin(everyone)
        hands = [ContactView(env.scene, name) for name in ("left", "right")]
        carried: list[np.ndarray] = []
        while not policy.skill.outcome.all():
            env.step(policy.act(everyone))
            env.scene.look(None)
            if (env.scene.frame("box").position[:, 2] > 0.9).all():
                carried.append(np.array([hand.strength for hand in hands]))
        env.scene.look(None)
        assert [OUTCOMES[o] for o in policy.skill.outcome] == [Outcome.OK] * 2
        assert len(carried) > 100
        assert (np.array(carried).min(axis=0) > 10.0).all(), "both press, all the way"
        assert (np.array(carried).max(axis=0) < 80.0).all()
        assert all((hand.strength == 0.0).all() for hand in hands)
        off = env.scene.frame("box").position[:, 2] - 0.85
        assert (np.abs(off) < 0.002).all()


def test_a_box_wider_than_it_seems_to_be_is_missed() -> None:
    """Palms that close on nothing say so: the ends are 12 cm further out than they are."""
    require_engine("mujoco")
    away = "collect.commands.2.ends=[[0.03,0.27,0],[0.03,-0.27,0]]"
    with make(TASK, engine="mujoco", num_envs=1, overrides=[*blinding(TASK), away]) as env:
        env.reset(seed=6)
        policy = SkillPolicy(env)
        policy.begin(np.arange(1))
        while env.running.all() and not policy.gave_up(np.arange(1)).all():
            env.step(policy.act(np.arange(1)))
        assert policy.gave_up(np.arange(1)).all()
        ladder = policy.describe(0)["ladder"]
    assert isinstance(ladder, list)
    assert ladder[0].startswith(("missed_contact", "no_ik")), ladder

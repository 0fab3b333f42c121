"""DexOpen: hooks behind the bar from above, and what becomes of a drawer that does not move."""

import numpy as np
import pytest

import anysim
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.skills.runner import SkillPolicy
from anysim_skills.articulated.bar_grasps import hooks
from anysim_skills.articulated.dex_open import DexOpen
from tests.tasks.states import blinding

QUIET = ["level=L0", *blinding("dex_open_drawer")]


def skill_of(policy: SkillPolicy) -> DexOpen:
    assert isinstance(policy.skill, DexOpen)
    return policy.skill


def test_hooks_point_the_palm_away_from_the_front_and_the_fingers_across_the_bar() -> None:
    turns = hooks(np.array([0.0, 0.2]))
    out, fingers = (P.rotate(turns, np.tile(axis, (len(turns), 1))) for axis in np.eye(3)[[2, 1]])
    assert np.allclose(out[:2], [1.0, 0.0, 0.0])
    assert np.allclose(out[2:], [np.cos(0.2), np.sin(0.2), 0.0])
    assert np.allclose(fingers[:, 2], 0.0)  # z is along the bar
    assert np.allclose(fingers[0], -fingers[1])


def test_the_fingers_come_from_above_and_open_the_drawer() -> None:
    with anysim.make("dex_open_drawer", engine="mujoco", num_envs=2, overrides=QUIET) as env:
        env.reset(seed=3)
        policy, seen = SkillPolicy(env), list[float]()
        policy.begin(np.arange(2))
        skill = skill_of(policy)
        for _ in range(500):
            env.step(policy.act(np.flatnonzero(env.running)), env.running)
            env.scene.look(None)
            hooked = skill.part.joint.opening > 0.2
            down = P.rotate(skill.arm.tool.quaternion, np.tile([0.0, 1.0, 0.0], (2, 1)))[:, 2]
            seen += down[hooked].tolist()
            if not env.running.any():
                break
        assert (env.status == "success").all()
        assert (skill.part.joint.opening > 0.75).all()
        assert max(seen) < -0.9


def test_a_drawer_that_is_stuck_ends_with_a_type() -> None:
    stuck = [*QUIET, "task.horizon=3000", "world.objects.cabinet.joints.drawer_1.friction=2000.0"]
    with anysim.make("dex_open_drawer", engine="mujoco", num_envs=1, overrides=stuck) as env:
        env.reset(seed=3)
        policy = SkillPolicy(env)
        policy.begin(np.array([0]))
        while env.running.all() and not policy.gave_up(np.array([0])).any():
            env.step(policy.act(np.array([0])))
        assert skill_of(policy).part.joint.opening[0] < 0.05
        assert policy.ended(0, False)["outcome"] in ("jammed", "unstable_grasp", "missed_contact")


def test_a_posture_that_the_hand_does_not_know_is_said() -> None:
    with (
        anysim.make("dex_open_drawer", engine="mujoco", overrides=[*QUIET, "task.expert.synergy=fist"]) as env,
        pytest.raises(TaskError, match="no synergy 'fist'"),
    ):
        SkillPolicy(env)

"""The skill screw on real engines: a cap tightened and loosened with several grasps, and one that is stuck."""

import numpy as np
import pytest

from anysim import make
from anysim.errors import TaskError
from anysim.skills.base import Outcome
from anysim.skills.runner import SkillPolicy
from tests.plugins.skills.test_honest_failures import given_up
from tests.plugins.skills.test_manipulation import WORLDS, solved

LOOSENED = (
    "world.objects.jar.joints={cap: {opened: 1.0}}",
    "task.success.turned={term: closed, joint: jar.cap, share: 0.07}",
    "task.expert.fraction=0.03",
)


def test_a_cap_is_tightened_on_mujoco() -> None:
    assert solved("screw_jar", "mujoco", 4) == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_a_cap_is_tightened_on_the_other_engines(engine: str) -> None:
    assert solved("screw_jar", engine, 4) >= 0.75


def test_a_cap_is_loosened() -> None:
    assert solved("screw_jar", "mujoco", 2, *LOOSENED) == 1.0


def test_a_turn_is_made_of_equal_strokes_each_with_a_grasp_of_its_own() -> None:
    """0.97 of a turn takes three strokes of at most 2.3 rad: two thirds of the way the cap rests twice."""
    with make(WORLDS / "screw_jar.yaml", engine="mujoco", num_envs=1) as env:
        env.reset(seed=4)
        policy, cap = SkillPolicy(env), env.engine.index.joint("jar.cap")
        policy.begin(np.arange(1))
        angles, speeds = [], []
        for _ in range(1000):
            env.step(policy.act(np.arange(1)), env.running)
            state = env.engine.get_state()
            angles.append(float(state.joint_pos[0, cap]))
            speeds.append(float(state.joint_vel[0, cap]))
            if not env.running.any():
                break
    assert env.status.tolist() == ["success"]
    rests = [angle for angle, speed in zip(angles, speeds, strict=True) if abs(speed) < 1e-3]
    stroke = 0.97 * 2 * np.pi / 3
    for number in range(4):
        assert sum(abs(angle - number * stroke) < 0.15 for angle in rests) > 20, number
    assert sum(min(abs(angle - n * stroke) for n in range(4)) < 0.15 for angle in rests) == len(rests)


def test_one_that_is_stuck_is_jammed() -> None:
    outcomes, said = given_up("screw_jar", "world.objects.jar.source.params.friction=500.0")
    assert outcomes == [Outcome.JAMMED] * 2
    assert said["ladder"] == ["jammed -> back_off", "jammed -> recover", "jammed -> give up"]


def test_what_slides_is_not_screwed() -> None:
    expert = "task.expert={skill: screw, part: cabinet.drawer_1}"
    with (
        make(WORLDS / "open_drawer.yaml", engine="mujoco", overrides=["task.expert=null", expert]) as env,
        pytest.raises(TaskError, match=r"'cabinet\.drawer_1' does not turn, it is a prismatic joint"),
    ):
        SkillPolicy(env)

"""The skill turn on real engines: a lever, a wheel more than half round, and one that is stuck."""

import json

import numpy as np
import pytest

from anysim import make
from anysim.errors import TaskError
from anysim.skills.base import Outcome
from anysim.skills.runner import SkillPolicy
from tests.plugins.skills.test_honest_failures import given_up
from tests.plugins.skills.test_manipulation import WORLDS, solved

VALVE = "world.objects.valve.source.params"
WHEEL = (f"{VALVE}.style=wheel", f"{VALVE}.radius=0.12", "task.expert.inset=0.05")


def test_a_lever_is_turned_on_mujoco() -> None:
    assert solved("turn_valve", "mujoco", 4) == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_a_lever_is_turned_on_the_other_engines(engine: str) -> None:
    assert solved("turn_valve", engine, 4) >= 0.75


@pytest.mark.slow
def test_a_wheel_is_turned_clockwise_further_than_a_wrist_turns() -> None:
    far = (f"{VALVE}.limits=[-6.0,0.5]", "task.expert.angle=-5.5")
    assert solved("turn_valve", "mujoco", 2, *WHEEL, *far) == 1.0


def test_a_wheel_without_limits_is_turned_by_an_angle_from_where_it_is() -> None:
    endless = (f"{VALVE}.limits=null", "task.success=null", "task.expert.angle=2.0")
    with make(WORLDS / "turn_valve.yaml", engine="mujoco", num_envs=2, overrides=[*WHEEL, *endless]) as env:
        env.reset(seed=4)
        policy = SkillPolicy(env)
        policy.begin(np.arange(2))
        for _ in range(400):
            env.step(policy.act(np.arange(2)))
        wheel = [joint.name for joint in env.engine.world.joints].index("valve.wheel")
        assert env.engine.get_state().joint_pos[:, wheel] == pytest.approx([2.0, 2.0], abs=0.15)


def test_one_that_is_stuck_is_jammed() -> None:
    outcomes, said = given_up("turn_valve", f"{VALVE}.friction=500.0")
    assert outcomes == [Outcome.JAMMED] * 2
    assert said["ladder"] == ["jammed -> back_off", "jammed -> recover", "jammed -> give up"]


def test_what_slides_is_not_turned() -> None:
    expert = "task.expert={skill: turn, part: cabinet.drawer_1, angle: 1.0}"
    with (
        make(WORLDS / "open_drawer.yaml", engine="mujoco", overrides=["task.expert=null", expert]) as env,
        pytest.raises(TaskError, match=r"'cabinet\.drawer_1' does not turn, it is a prismatic joint"),
    ):
        SkillPolicy(env)


def test_a_wheel_is_turned_to_a_position_and_back() -> None:
    """Whichever way that is: there counterclockwise, back clockwise."""
    there, back = ({"do": "turn_to", "robot": "panda", "part": "valve.wheel", "position": p} for p in (1.2, 0.4))
    commands = f"collect={json.dumps({'commands': [there, back]})}"
    words = [*WHEEL[:2], f"{VALVE}.limits=null", "task.success=null", "task.expert=null", commands]
    with make(WORLDS / "turn_valve.yaml", engine="mujoco", num_envs=2, overrides=words) as env:
        wheel = [joint.name for joint in env.engine.world.joints].index("valve.wheel")
        env.reset(seed=4)
        policy = SkillPolicy(env)
        policy.begin(np.arange(2))
        most = np.zeros(2)
        for _ in range(650):
            env.step(policy.act(np.arange(2)))
            most = np.maximum(most, env.engine.get_state().joint_pos[:, wheel])
        assert most == pytest.approx([1.2, 1.2], abs=0.15)
        assert env.engine.get_state().joint_pos[:, wheel] == pytest.approx([0.4, 0.4], abs=0.15)


def test_a_position_beyond_the_limits_is_refused() -> None:
    expert = "task.expert={skill: turn_to, robot: panda, part: valve.wheel, position: 2.5}"
    with (
        make(WORLDS / "turn_valve.yaml", engine="mujoco", overrides=["task.expert=null", expert]) as env,
        pytest.raises(TaskError, match=r"'valve\.wheel' turns from 0 to 2 rad, not to 2\.5"),
    ):
        SkillPolicy(env)

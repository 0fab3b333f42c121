"""ServoL, RetractMoveL and the skill probe: a hand stops at a force, never leads by more than is stated, and leaves."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_skills.moving.probe import Probe
from anysim_skills.moving.servo import ServoL, ServoLimits

WORLD = Path(__file__).parent / "worlds/probe.yaml"
FACE = 0.5
"""[m] x of the side of the wall that the hand goes to."""
OTHERS = [pytest.param(e, marks=pytest.mark.slow) for e in ("pybullet", "sapien")]
BEHIND = (
    "world.objects.rear={source: {box: [0.06, 0.4, 0.36]}, fixed: true}",
    "world.layout.rear={position: [0.31, 0.0, 0.58]}",
    "task.expert.retreat=0.2",
)


def probing(engine: str, *overrides: str) -> TaskEnv:
    require_engine(engine)
    return make(WORLD, engine=engine, num_envs=2, overrides=overrides)


def steps(env: TaskEnv, most: int = 800) -> Iterator[Probe]:
    """The skill after each control step, until it has ended in all envs."""
    env.reset(seed=11)
    policy, everyone = SkillPolicy(env), np.arange(env.num_envs)
    policy.begin(everyone)
    assert isinstance(policy.skill, Probe)
    for _ in range(most):
        env.step(policy.act(everyone))
        env.scene.look(None)
        yield policy.skill
        if policy.skill.outcome.all():
            return


def outcomes(skill: Probe) -> list[Outcome]:
    return [OUTCOMES[code] for code in skill.outcome]


@pytest.mark.parametrize("engine", ["mujoco", *OTHERS])
def test_a_hand_feels_the_wall_and_goes_back(engine: str) -> None:
    with probing(engine) as env:
        *_, skill = steps(env)
        assert outcomes(skill) == [Outcome.OK] * 2
        assert skill.servo.gated.all()
        back = P.norm(skill.arm.tool.position - skill.back._from[:, :3])  # pyright: ignore[reportPrivateUsage]
        assert np.abs(back - 0.08).max() < 0.01
        assert (skill._sensor.strength == 0).all()  # pyright: ignore[reportPrivateUsage]


@pytest.mark.parametrize("engine", ["mujoco", *OTHERS])
def test_the_servo_stops_at_the_force_that_was_stated(engine: str) -> None:
    """Slowly, so that the wall is pressed and not hit."""
    with probing(engine) as env:
        felt = pressed(env, ServoLimits(speed=0.02, force=15.0))
        assert ((felt > 0.5 * 15.0) & (felt < 1.2 * 15.0)).all()


@pytest.mark.parametrize("engine", ["mujoco", *OTHERS])
def test_without_a_gate_the_lead_bounds_what_is_pressed(engine: str) -> None:
    with probing(engine) as env:
        felt = pressed(env, ServoLimits(speed=0.1))
        assert (felt > 50.0).all()


def pressed(env: TaskEnv, limits: ServoLimits) -> Array:
    """(n,) [N] on the wall after 700 control steps towards a place behind its face; the lead is held to in all."""
    env.reset(seed=11)
    policy, ids = SkillPolicy(env), np.arange(env.num_envs)
    policy.begin(ids)
    skill = policy.skill
    assert isinstance(skill, Probe)
    skill.servo = ServoL(skill.arm, limits)
    arm, sensor = skill.arm, skill._sensor  # pyright: ignore[reportPrivateUsage]
    env.scene.look(ids)
    arm.prepare(ids)
    arm.closed[:] = True
    goal = np.concatenate([env.scene.frame("deep").position, arm.tool.quaternion], axis=1)
    action = np.zeros_like(policy.act(ids))
    for _ in range(700):
        env.scene.look(ids)
        skill.servo.step(ids, ids, goal, sensor.strength)
        assert P.norm(arm.command[:, :3] - arm.tool.position).max() <= limits.lead
        arm.act(ids, action)
        assert P.norm(arm.command[:, :3] - arm.tool.position).max() <= limits.lead
        env.step(action)
    env.scene.look(ids)
    assert (arm.tool.position[:, 0] < FACE).all()
    return sensor.strength


@pytest.mark.parametrize("engine", ["mujoco", *OTHERS])
def test_a_hand_with_something_behind_it_stops_there(engine: str) -> None:
    with probing(engine, *BEHIND) as env:
        *_, skill = steps(env)
        assert outcomes(skill) == [Outcome.JAMMED] * 2
        assert skill.back.blocked.all()
        assert (skill.arm.tool.position[:, 0] > 0.34).all()  # the face of what is behind
        assert P.norm(skill.arm.command[:, :3] - skill.arm.tool.position).max() < 0.01  # it does not press on


def test_where_no_wall_is_met_contact_was_missed() -> None:
    with probing("mujoco", "world.layout.wall={position: [0.9, 0.0, 0.65]}") as env:
        *_, skill = steps(env)
        assert outcomes(skill) == [Outcome.MISSED_CONTACT] * 2

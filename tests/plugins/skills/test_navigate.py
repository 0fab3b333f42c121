"""Bases drive to where they are sent and stop there; one that is held up says so."""

from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_skills.moving.navigate import Navigate
from tests.plugins.skills.test_pick import rollout

WORLD = Path(__file__).parent / "worlds/navigate.yaml"
FETCH = WORLD.with_name("fetch.yaml")
BASES = {"holonomic_base": "holonomic_drive", "differential_base": "differential_drive"}


def driven(env: TaskEnv, steps: int) -> list[Outcome]:
    """The outcome of the skill in each env, whether or not the task has ended well."""
    env.reset(seed=11)
    policy, everyone = SkillPolicy(env), np.arange(env.num_envs)
    policy.begin(everyone)
    for _ in range(steps):
        if policy.skill.outcome.all():
            break
        env.step(policy.act(everyone))
    return [OUTCOMES[code] for code in policy.skill.outcome]


def sent(engine: str, base: str, num_envs: int, *overrides: str) -> TaskEnv:
    """A base of the catalogue; its task does not end with success."""
    require_engine(engine)
    robot = [f"world.robots.base.robot={base}", f"world.robots.base.actions.base={BASES[base]}"]
    return make(WORLD, engine=engine, num_envs=num_envs, overrides=[*robot, "task.on_success=continue", *overrides])


def arrives(engine: str, base: str, num_envs: int) -> None:
    with sent(engine, base, num_envs) as env:
        assert driven(env, 800) == [Outcome.OK] * num_envs
        env.scene.look(None)
        here, goal = env.scene.robot("base").base, env.scene.frame("spot").pose
        assert (np.linalg.norm(here.position[:, :2] - goal[:, :2], axis=1) < 0.02).all()
        assert (np.abs(P.wrapped(P.yaw(here.quaternion) - P.yaw(goal[:, 3:]))) < np.deg2rad(2)).all()
        assert (np.abs(here.twist[:, [0, 1, 5]]) < 0.02).all()


@pytest.mark.parametrize("base", BASES)
def test_a_base_arrives_and_stops(base: str) -> None:
    arrives("mujoco", base, 4)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
@pytest.mark.parametrize("base", BASES)
def test_it_arrives_on_the_other_engines(base: str, engine: str) -> None:
    arrives(engine, base, 4)


def test_a_base_before_a_wall_is_held_up() -> None:
    wall = (
        "world.objects.wall={source: {box: [0.1, 8.0, 1.0]}, fixed: true}",
        "world.layout.wall={position: [1.0, 0.0, 0.5]}",
        "world.layout.spot={position: [2.0, 0.0, -0.02], checked: false}",
    )
    with sent("mujoco", "differential_base", 1, *wall) as env:
        assert driven(env, 800) == [Outcome.CONTROLLER]


def test_the_way_back_is_driven_backwards_where_it_is_short() -> None:
    """A differential base that stands 0.2 m before its goal, with its back to it, need not turn."""
    behind = "world.layout.spot={position: [-0.2, 0.0, -0.02], yaw: 0.0, checked: false}"
    with sent("mujoco", "differential_base", 1, behind) as env:
        env.reset(seed=1)
        policy = SkillPolicy(env)
        policy.begin(np.array([0]))
        yaws = []
        while not policy.skill.outcome[0]:
            env.step(policy.act(np.array([0])))
            yaws.append(float(P.yaw(env.scene.robot("base").base.quaternion)[0]))
        assert isinstance(policy.skill, Navigate)
        assert np.abs(yaws).max() < 0.1


@pytest.mark.parametrize(
    "engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ("pybullet", "sapien"))]
)
def test_a_mobile_arm_drives_to_a_table_and_takes_a_cube(engine: str) -> None:
    require_engine(engine)
    with make(FETCH, engine=engine, num_envs=2) as env:
        env.reset(seed=11)
        assert rollout(env, SkillPolicy(env), 500) == ["success"] * 2


def test_an_arm_that_is_carried_keeps_its_place_on_the_base() -> None:
    with make(FETCH, engine="mujoco") as env:
        env.reset(seed=11)
        policy, one = SkillPolicy(env), np.array([0])
        policy.begin(one)
        base, tool = env.scene.robot("robot").base, env.scene.robot("robot").tool()
        begun = P.compose(P.inverse(base.pose), tool.pose)
        while policy.skill.phase[0] == 0:
            env.step(policy.act(one))
            now = P.compose(P.inverse(base.pose), tool.pose)
            assert P.norm(now - begun)[0] < 0.02
        assert base.position[0, 0] > 1.3

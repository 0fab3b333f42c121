"""MobileMoveL, MobileServoL and the skill mobile_reach: the tool keeps to its line while the base below it travels."""

from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_skills.moving.base import Base
from anysim_skills.moving.mobile import MobileLimits, MobileServoL
from anysim_skills.moving.mobile_reach import MobileReach

WORLD = Path(__file__).parent / "worlds/mobile_reach.yaml"
ENGINES = ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ("pybullet", "sapien"))]
OFF_LINE = 0.0025
"""[m] as large as the tool's way off its line may be here; the base travels 1.1 m and turns by 0.5 rad below it."""
WALL = (
    "world.objects.wall={source: {box: [0.1, 1.0, 1.4]}, fixed: true}",
    "world.layout.wall={position: [1.2, 0.2, 0.7]}",
    "world.layout.spot={position: [0.4, 0.0, 0.0], yaw: 0.0, checked: false}",
)


def mobile(engine: str, *overrides: str) -> TaskEnv:
    require_engine(engine)
    return make(WORLD, engine=engine, num_envs=2, overrides=overrides)


def started(env: TaskEnv) -> tuple[SkillPolicy, MobileReach]:
    env.reset(seed=11)
    policy = SkillPolicy(env)
    policy.begin(np.arange(env.num_envs))
    assert isinstance(policy.skill, MobileReach)
    env.scene.look(None)
    return policy, policy.skill


@pytest.mark.parametrize("engine", ENGINES)
def test_the_tool_keeps_to_its_line_while_the_base_travels_and_turns(engine: str) -> None:
    with mobile(engine) as env:
        policy, skill = started(env)
        ids, tool = np.arange(2), env.scene.robot("robot").tool()
        begun, goal = tool.position.copy(), env.scene.frame("ball").position.copy()
        along = (goal - begun) / P.norm(goal - begun)[:, None]
        off = []
        while not skill.outcome.all():
            env.step(policy.act(ids))
            way = tool.position - begun
            off.append(P.norm(way - P.dot(way, along)[:, None] * along).max())
        assert [OUTCOMES[code] for code in skill.outcome] == [Outcome.OK] * 2
        assert max(off) < OFF_LINE
        assert (P.norm(tool.position - goal) < 0.005).all()
        assert np.abs(skill.base.pose(ids) - [1.1, 0.0, 0.5]).max() < 0.02


@pytest.mark.parametrize("engine", ENGINES)
def test_a_live_target_is_followed_from_a_base_that_travels(engine: str) -> None:
    """The target swings by 8 cm aside while the base drives 0.4 m; the tool stays within 2 cm of it."""
    with mobile(engine) as env:
        policy, skill = started(env)
        ids, arm = np.arange(2), skill.arm
        servo = MobileServoL(arm, skill.base, MobileLimits(deviation=0.01))
        action = np.zeros_like(policy.act(ids))
        servo.begin(ids, ids)
        begun, stand = arm.tool.pose.copy(), skill.base.pose(ids) + np.array([0.4, 0.0, 0.0])
        for step in range(250):
            env.scene.look(ids)
            target = begun.copy()
            target[:, 0] += 0.4 * min(1.0, step / 125)
            target[:, 1] += 0.08 * np.sin(step * 0.04)
            assert np.isin(servo.step(ids, ids, target, stand), (STAY, GO_ON)).all()
            assert P.norm(target[:, :3] - arm.tool.position).max() < 0.02
            skill.base.act(ids, action)
            arm.act(ids, action)
            env.step(action)
        assert (skill.base.pose(ids)[:, 0] > 0.37).all()


def test_a_tool_that_is_held_back_is_a_failure_of_the_controller() -> None:
    with mobile("mujoco", *WALL) as env:
        policy, skill = started(env)
        ids = np.arange(2)
        while not skill.outcome.all():
            env.step(policy.act(ids))
        assert [OUTCOMES[code] for code in skill.outcome] == [Outcome.CONTROLLER] * 2
        assert (env.scene.robot("robot").tool().position[:, 0] < 1.15).all()  # the face of the wall
        assert ((skill.move.servo.deviation > 0.02) & (skill.move.servo.deviation < 0.03)).all()


def test_a_base_that_turns_towards_where_it_drives_is_refused() -> None:
    drive = ("world.robots.base.robot=differential_base", "world.robots.base.actions.base=differential_drive")
    with mobile("mujoco") as env, make(WORLD.with_name("navigate.yaml"), engine="mujoco", overrides=drive) as other:
        arm = started(env)[1].arm
        with pytest.raises(TaskError, match=r"turns towards where it drives.*holonomic_drive or planar_drive"):
            MobileServoL(arm, Base.of(other, other.scene.robot("base")), MobileLimits())

"""Two arms that move at once: neither hits the other where straight or separately planned ways do."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_skills.arm import Arm
from anysim_skills.planning import WORKERS_VARIABLE
from anysim_skills.two_hands.arm_pair import ArmPair
from tests.plugins.skills.test_pick import rollout
from tests.tiers import often

WORLD = Path(__file__).parent / "worlds/bi_lift.yaml"
DOWN = (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)
"""How the tool of each looks down: they face each other."""
BEGIN = np.array([[0.45, 0.25, 0.5, *DOWN[0]], [0.45, -0.25, 0.5, *DOWN[1]]])
"""Where the two tools are at first, on either side."""
END = np.array([[0.45, -0.25, 0.95, *DOWN[0]], [0.45, 0.25, 0.95, *DOWN[1]]])
"""Where they are to be, each above where the other began: all ways lead through the middle."""
STEPS = 400
ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]
HOMES = [f"world.robots.{name}.home={{panda_joint1: 0.5}}" for name in ("panda", "partner")]
"""Hands beside each other at first, not in front of each other, where they would touch."""


@contextmanager
def facing(num_envs: int, engine: str = "mujoco") -> Iterator[TaskEnv]:
    require_engine(engine)
    with make(WORLD, engine=engine, num_envs=num_envs, overrides=["task.horizon=2000", *HOMES]) as env:
        env.reset(seed=11)
        yield env


def arms_of(env: TaskEnv, planner: str) -> tuple[Arm, Arm]:
    first, second = (Arm.of(env, env.scene.robot(name), planner=planner) for name in ("panda", "partner"))
    ids = np.arange(env.num_envs)
    env.scene.look(ids)
    for arm in (first, second):
        arm.renew(ids)
        arm.prepare(ids)
    return first, second


def driven(env: TaskEnv, arms: tuple[Arm, Arm], steps: int) -> tuple[Array, Array]:
    """Let both arms act: (steps, N, J) where the joints were, and (N,) in how many steps one arm touched the other."""
    ids, joints, hits = np.arange(env.num_envs), [], np.zeros(env.num_envs, dtype=int)
    owner = np.array([*env.engine.world.body_entity, -1])
    robots = [env.engine.world.entity_numbers[name] for name in ("panda", "partner")]
    for _ in range(steps):
        env.scene.look(ids)
        action = np.zeros((env.num_envs, env.action_dim))
        for arm in arms:
            arm.act(ids, action)
        for service in arms[0].planners:
            service.flush()
        env.step(action)
        joints.append(env.engine.get_state().joint_pos.copy())
        seen = env.engine.contacts()
        one, other = owner[seen.body_a], owner[seen.body_b]
        between = np.isin(one, robots) & np.isin(other, robots) & (one != other)
        hits[np.unique(seen.env[between])] += 1
    return np.array(joints), hits


def begun(env: TaskEnv, planner: str = "") -> tuple[Arm, Arm]:
    """Both arms, when their tools are where the ways begin."""
    arms, ids = arms_of(env, planner), np.arange(env.num_envs)
    for arm, pose in zip(arms, BEGIN, strict=True):
        arm.go(ids, np.tile(pose, (env.num_envs, 1)), 0.4)
    _, hits = driven(env, arms, 100)
    assert not hits.any()
    env.scene.look(ids)
    assert all(arm.arrived(ids, ids, 0.01, 0.1).all() for arm in arms)
    return arms


def crossed(env: TaskEnv) -> tuple[Array, Array]:
    """Both go at once, by one plan; what `driven` says."""
    arms, ids = begun(env), np.arange(env.num_envs)
    pair = ArmPair.of(*arms, planner="rrt")
    pair.plan(ids, [END[:, None]] * env.num_envs)
    joints, hits = driven(env, arms, STEPS)
    assert [OUTCOMES[said] for said in pair.plans.said(ids)] == [Outcome.OK] * env.num_envs
    env.scene.look(ids)
    for arm, pose in zip(arms, END, strict=True):
        assert np.linalg.norm(arm.tool.position - pose[:3], axis=1).max() < 0.02
    return joints, hits


@pytest.mark.parametrize("engine", ENGINES)
def test_one_plan_for_both_arms_keeps_them_apart(engine: str) -> None:
    """The engine says what touches, which knows nothing of plans."""
    with facing(4 if engine == "mujoco" else 2, engine) as env:
        assert not crossed(env)[1].any()


def test_straight_lines_and_separate_plans_make_them_collide() -> None:
    with facing(2) as env:
        arms, ids = begun(env), np.arange(2)
        for arm, pose in zip(arms, END, strict=True):
            arm.go(ids, np.tile(pose, (2, 1)), 0.4)
        assert driven(env, arms, STEPS)[1].all()
    with facing(2) as env:  # each plan takes the other arm as it is when it is asked for
        arms = begun(env, "rrt")
        for arm, pose in zip(arms, END, strict=True):
            arm.plan(ids, np.tile(pose, (2, 1, 1)))
        assert driven(env, arms, STEPS)[1].any()


@pytest.mark.slow
def test_neither_workers_nor_other_envs_change_what_they_do(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    for num_envs, workers in ((4, "1"), (4, "2"), (16, "2")):
        monkeypatch.setenv(WORKERS_VARIABLE, workers)
        with facing(num_envs) as env:
            joints, hits = crossed(env)
            assert not hits.any()
            seen.append(joints[:, :4].tobytes())
    assert seen[0] == seen[1] == seen[2]


def test_the_other_arm_waits_for_the_one_that_is_held_up() -> None:
    """They keep pace: a path that is free at one pace is not free at two."""
    with facing(1) as env:
        arms, ids = begun(env), np.arange(1)
        pair = ArmPair.of(*arms, planner="rrt")
        pair.plan(ids, [END[:, None]])
        driven(env, arms, 60)
        body = env.engine.index.body("panda.panda_link7")
        told = []
        for _ in range(30):
            env.engine.apply_wrench(np.array([[[0.0, 0.0, -400.0, 0.0, 0.0, 0.0]]]), bodies=[body])
            driven(env, arms, 1)
            told.append(arms[1].joints[0].copy())
        assert any((a == b).all() for a, b in pairwise(told))


def test_another_command_to_one_of_them_ends_the_plan_of_both() -> None:
    with facing(1) as env:
        arms, ids = begun(env), np.arange(1)
        ArmPair.of(*arms, planner="rrt").plan(ids, [END[:, None]])
        driven(env, arms, 40)
        arms[1].stay(ids)
        before = [arm.joints.copy() for arm in arms]
        driven(env, arms, 20)
        assert all(np.abs(arm.joints - there).max() < 0.05 for arm, there in zip(arms, before, strict=True))


def test_both_have_the_planner_of_each() -> None:
    with facing(1) as env:
        arms = arms_of(env, "rrt")
        with pytest.raises(TaskError, match="the same planner and latency"):
            ArmPair.of(*arms, planner="rrt", latency=9)


@pytest.mark.parametrize("task", often(["handover"], ["bi_lift", "handover"]))
def test_skills_of_two_arms_plan_both_at_once(task: str) -> None:
    """And say so in their records; phases `plan` are passed in each env."""
    require_engine("mujoco")
    file = WORLD if task == "bi_lift" else task
    overrides = ["task.expert.planner=rrt", "task.expert.latency=8", *HOMES]
    with make(file, engine="mujoco", num_envs=4, overrides=overrides) as env:
        env.reset(seed=11)
        policy, kinds = SkillPolicy(env), []
        (service,) = policy.planners
        submit = service.submit
        service.submit = lambda request, *rest, **more: (kinds.append(request.kind), submit(request, *rest, **more))[1]  # type: ignore[method-assign]
        assert rollout(env, policy, 1500) == ["success"] * 4
        assert policy.describe(0)["planner"] == {"name": "rrt", "version": "1", "latency": 8}
    assert kinds.count("dual_motion") >= 4
    assert ("motion" in kinds) == (task == "handover"), kinds  # where one arm moves after the other

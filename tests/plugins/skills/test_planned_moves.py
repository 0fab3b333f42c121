"""Planned moves: around what is in the way, honest about what cannot be done, and the same however many plan."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.conventions import Array
from anysim.errors import PluginError, TaskError
from anysim.planning.service import SERVICE_VARIABLE
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import STAY
from anysim.skills.runner import SkillPolicy
from anysim.task.contract import Status
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_planning import queued
from anysim_planning.rrt import RrtPlanner
from anysim_skills import planned_moves
from anysim_skills.arm import Arm
from anysim_skills.planning import WORKERS_VARIABLE, planner_of
from tests.plugins.skills.test_pick import rollout
from tests.tiers import others

WALL = Path(__file__).parent / "worlds/behind_wall.yaml"
STEPS = 1000


def behind_wall(*overrides: str, engine: str = "mujoco", num_envs: int = 2) -> TaskEnv:
    env = make(WALL, engine=engine, num_envs=num_envs, overrides=overrides)
    env.reset(seed=11)
    return env


def test_what_is_behind_a_wall_is_fetched_with_a_planner_and_not_without() -> None:
    for planner, status in (("rrt", Status.SUCCESS), ("", Status.TRUNCATED)):
        with behind_wall(f"task.expert.planner={planner!r}") as env:
            policy = SkillPolicy(env)
            assert rollout(env, policy, STEPS) == [status] * 2
            assert ("planner" in policy.describe(0)) == bool(planner)


@pytest.mark.parametrize("engine", others("sapien"))
def test_it_is_fetched_on_the_other_engines(engine: str) -> None:
    require_engine(engine)
    with behind_wall(engine=engine, num_envs=4) as env:
        assert rollout(env, SkillPolicy(env), STEPS).count(Status.SUCCESS) >= 3


def test_records_say_who_has_planned() -> None:
    with behind_wall() as env:
        assert SkillPolicy(env).describe(0)["planner"] == {"name": "rrt", "version": "1", "latency": 5}


def driven(env: TaskEnv, arm: Arm, steps: int, until: Callable[[], bool] = lambda: False) -> Array:
    """Let the arm act by itself; (steps, K) where its joints were in env 0."""
    ids, seen = np.arange(env.num_envs), []
    for _ in range(steps):
        if until():
            break
        env.scene.look(ids)
        action = np.zeros((env.num_envs, env.action_dim))
        arm.act(ids, action)
        for service in arm.planners:
            service.flush()
        env.step(action)
        seen.append(env.engine.get_state().joint_pos[0, arm.chain.joints])
    return np.array(seen)


def asked(env: TaskEnv, height: float = 0.6, **more: object) -> Arm:
    """An arm that was told to plan to a place behind the wall."""
    ids = np.arange(env.num_envs)
    arm = Arm.of(env, env.scene.robot("panda"), planner="rrt", latency=4)
    env.scene.look(ids)
    arm.renew(ids)
    arm.prepare(ids)
    goal = np.tile([0.42, 0.32, height, 1.0, 0.0, 0.0, 0.0], (env.num_envs, 1, 1))
    arm.plan(ids, goal, **more)  # type: ignore[arg-type]
    return arm


def test_the_arm_waits_for_its_latency_and_then_follows() -> None:
    with behind_wall() as env:
        arm = asked(env)
        begin = arm.joints.copy()
        driven(env, arm, 4)
        assert (arm.joints == begin).all()
        driven(env, arm, 1)
        assert (arm.joints != begin).any(axis=1).all()
        assert (arm.planned(np.arange(2)) == STAY).all()
        driven(env, arm, 500, lambda: bool((arm.planned(np.arange(2)) != STAY).all()))
        assert [OUTCOMES[said] for said in arm.planned(np.arange(2))] == [Outcome.OK] * 2
        env.scene.look(None)
        assert np.linalg.norm(arm.tool.position - [0.42, 0.32, 0.6], axis=1).max() < 0.02


def test_in_real_time_an_answer_takes_effect_once_it_is_ready() -> None:
    with behind_wall() as env:
        ids = np.arange(2)
        with pytest.warns(UserWarning, match="the run cannot be repeated"):
            arm = Arm.of(env, env.scene.robot("panda"), planner="rrt", latency="realtime")
        env.scene.look(ids)
        arm.renew(ids)
        arm.prepare(ids)
        begin = arm.joints.copy()
        arm.plan(ids, np.tile([0.42, 0.32, 0.6, 1.0, 0.0, 0.0, 0.0], (2, 1, 1)))
        assert arm.plans is not None
        futures = [question.future for question in arm.plans._questions.values()]
        arm.plans.planner.service.flush()
        while not all(future.done for future in futures):
            assert arm.plans.planner.service.counts.late == 0  # nobody waits
            time.sleep(0.01)
        driven(env, arm, 1)
        assert (arm.joints != begin).any(axis=1).all()
        assert arm.plans.describe()["latency"] == "realtime"
        assert arm.plans.planner.service.counts.late == 0


def test_in_real_time_a_planner_that_hangs_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    go_on = threading.Event()
    monkeypatch.setattr(RrtPlanner, "plan", lambda *_: go_on.wait(30.0))
    monkeypatch.setattr(planned_moves, "DEADLINE", 0.05)
    monkeypatch.setattr(queued, "GRACE", 0.05)
    monkeypatch.setenv(SERVICE_VARIABLE, "threads")
    with behind_wall() as env:
        with pytest.warns(UserWarning, match="the run cannot be repeated"):
            arm = Arm.of(env, env.scene.robot("panda"), planner="rrt", latency="realtime")
        env.scene.look(None)
        ids = np.arange(2)
        arm.renew(ids)
        arm.prepare(ids)
        arm.plan(ids, np.tile([0.42, 0.32, 0.6, 1.0, 0.0, 0.0, 0.0], (2, 1, 1)))
        try:
            for _ in range(500):
                driven(env, arm, 1)
                if (arm.planned(ids) != STAY).all():
                    break
                time.sleep(0.01)
            assert [OUTCOMES[said] for said in arm.planned(ids)] == [Outcome.TIMEOUT] * 2
        finally:
            go_on.set()


def test_another_command_takes_the_place_of_a_plan() -> None:
    with behind_wall() as env:
        arm, ids = asked(env), np.arange(2)
        driven(env, arm, 2)
        arm.stay(ids)
        begin = arm.joints.copy()
        driven(env, arm, 10)
        assert np.abs(arm.joints - begin).max() < 0.01


def test_what_has_changed_meanwhile_is_checked_again() -> None:
    with behind_wall() as env:
        arm = asked(env)
        driven(env, arm, 2)
        cube = env.engine.index.body("cube")
        env.engine.set_body_state(
            np.array([[[0.42, 0.32, 0.62, 0, 0, 0, 1.0]]]), np.zeros((1, 1, 6)), bodies=[cube], env_ids=[0]
        )
        env.scene.look(None)
        arm.plans.move(np.arange(2))  # type: ignore[union-attr]
        env.scene.elapsed[:] += 4
        env.scene.look(None)
        arm.plans.move(np.arange(2))  # type: ignore[union-attr]
        said = [OUTCOMES[outcome] for outcome in arm.planned(np.arange(2))]
        assert said == [Outcome.NO_PATH, Outcome.RUNNING]


@pytest.mark.parametrize(
    ("height", "outcome"), [(0.405, Outcome.COLLISION), (2.5, Outcome.NO_IK)], ids=["in the table", "out of reach"]
)
def test_a_goal_that_cannot_be_says_why(height: float, outcome: Outcome) -> None:
    with behind_wall() as env:
        arm = asked(env, height)
        driven(env, arm, 10)
        assert [OUTCOMES[said] for said in arm.planned(np.arange(2))] == [outcome] * 2


def test_the_line_after_a_move_has_to_be_free_too() -> None:
    with behind_wall() as env:
        through = np.tile([0.42, 0.32, 0.405, 1.0, 0.0, 0.0, 0.0], (2, 1))
        arm = asked(env, then=through)
        driven(env, arm, 10)
        assert [OUTCOMES[said] for said in arm.planned(np.arange(2))] == [Outcome.COLLISION] * 2


def test_workers_end_with_the_env() -> None:
    before = threading.active_count()
    with behind_wall() as env:
        asked(env)
        assert threading.active_count() > before
    assert threading.active_count() == before


def test_one_arm_has_one_planner() -> None:
    with behind_wall() as env:
        asked(env)
        with pytest.raises(TaskError, match="the same planner and latency"):
            Arm.of(env, env.scene.robot("panda"), planner="rrt", latency=9)


def test_a_planner_that_is_not_there_is_told() -> None:
    with behind_wall("task.expert.planner=rtt") as env, pytest.raises(PluginError, match="did you mean 'rrt'"):
        SkillPolicy(env)


def test_planning_is_beside_the_loop_unless_the_environment_says_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    beside: list[bool] = []
    for chosen in (None, "threads"):
        if chosen is not None:
            monkeypatch.setenv(SERVICE_VARIABLE, chosen)
        with behind_wall() as env:
            beside.append(planner_of(env, "rrt").service.beside)
    assert beside == [True, False]
    monkeypatch.setenv(SERVICE_VARIABLE, "rrt")
    with behind_wall() as env, pytest.raises(PluginError, match="is a planner and no service"):
        planner_of(env, "rrt")


@pytest.mark.parametrize("workers", ["0", "two"])
def test_a_number_of_workers_that_is_none_is_told(workers: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(WORKERS_VARIABLE, workers)
    with behind_wall() as env, pytest.raises(TaskError, match=WORKERS_VARIABLE):
        asked(env)

"""Failures are honest: what cannot be solved ends with the right type after the ladder."""

from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.planning.motion import PlanAnswer, PlanRequest, PlanStatus
from anysim.planning.service import SERVICE_VARIABLE
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SETTLE, SkillPolicy
from anysim.testing.engines import require_engine
from anysim_planning.rrt import RrtPlanner
from anysim_recording.collector import Collector
from tests.plugins.skills.test_manipulation import STEPS, WORLDS
from tests.plugins.skills.test_pick import rollout

FAR_DRAWER = [f"world.layout.cabinet.{value}" for value in ("position=[1.4, 0.0, 0.4]", "on=null", "x=null", "y=null")]
CASES = {
    "a cube out of reach": ("behind_wall", ["world.layout.cube.x=0.75", "world.layout.cube.y=0.6"], Outcome.NO_IK),
    "a cube in a shaft that is too narrow": ("walled_in", [], Outcome.COLLISION),
    "a handle out of reach": ("open_drawer", FAR_DRAWER, Outcome.NO_IK),
    "a locked drawer": ("open_drawer", ["world.objects.cabinet.source.params.drawer_friction=2000.0"], Outcome.JAMMED),
}
ENGINES = ["mujoco", *(pytest.param(name, marks=pytest.mark.slow) for name in ("pybullet", "sapien"))]


def given_up(world: str, *overrides: str, engine: str = "mujoco") -> tuple[list[Outcome], dict[str, object]]:
    """The outcomes of two envs, and what the first one says."""
    require_engine(engine)
    with make(WORLDS / f"{world}.yaml", engine=engine, num_envs=2, overrides=overrides) as env:
        env.reset(seed=11)
        policy = SkillPolicy(env)
        rollout(env, policy, 2 * STEPS)
        assert policy.gave_up(np.arange(2)).all()
        return [OUTCOMES[o] for o in policy.skill.outcome], policy.describe(0)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("case", CASES)
def test_what_cannot_be_done_ends_with_its_type(case: str, engine: str) -> None:
    world, overrides, outcome = CASES[case]
    outcomes, said = given_up(world, *overrides, engine=engine)
    assert outcomes == [outcome] * 2
    ladder = said["ladder"]
    assert isinstance(ladder, list)
    assert len(ladder) > 1
    assert all(climbed.startswith(f"{outcome} -> ") for climbed in ladder)
    assert ladder[-1].endswith("give up")


def test_no_path_is_planned_again_with_another_seed_before_another_candidate(monkeypatch: pytest.MonkeyPatch) -> None:
    seeds: list[int] = []

    def none(self: RrtPlanner, request: PlanRequest, scene: object, budget: object) -> PlanAnswer:
        seeds.append(request.seed)
        return PlanAnswer(PlanStatus.NO_PATH)

    monkeypatch.setattr(RrtPlanner, "plan", none)
    monkeypatch.setenv(SERVICE_VARIABLE, "threads")
    outcomes, said = given_up("behind_wall")
    assert outcomes == [Outcome.NO_PATH] * 2
    ladder = said["ladder"]
    assert isinstance(ladder, list)
    assert ladder[:3] == ["no_path -> replan", "no_path -> replan", "no_path -> candidate"]
    assert len(set(seeds)) == len(seeds)


def test_a_planner_that_breaks_fails_the_episode_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(self: RrtPlanner, *_: object) -> PlanAnswer:
        raise ZeroDivisionError

    monkeypatch.setattr(RrtPlanner, "plan", broken)
    monkeypatch.setenv(SERVICE_VARIABLE, "threads")
    assert given_up("behind_wall")[0] == [Outcome.NO_PATH] * 2


def test_a_skill_that_succeeds_where_the_task_does_not_ends_the_episode(tmp_path: Path) -> None:
    overrides = ["record.cameras=[]", "task.success.at_goal.tolerance=1.0e-6"]
    with make("pick_cube", engine="mujoco", num_envs=2, overrides=overrides) as env:
        results = list(Collector(env, SkillPolicy(env), tmp_path, 2, seed=3).run())
        assert [(r.status, r.outcome["outcome"]) for r in results] == [("failed", "adverse_state")] * 2
        assert all(SETTLE < r.steps < env.spec.task.horizon for r in results if env.spec.task)

"""The skills on real engines: each solves a small world, and says how it failed where that cannot be solved."""

from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from tests.plugins.skills.test_pick import rollout

WORLDS = Path(__file__).parent / "worlds"
STEPS = 700


def solved(world: str, engine: str, num_envs: int, *overrides: str) -> float:
    """The share of envs that succeed."""
    require_engine(engine)
    with make(WORLDS / f"{world}.yaml", engine=engine, num_envs=num_envs, overrides=overrides) as env:
        env.reset(seed=11)
        return rollout(env, SkillPolicy(env), STEPS).count("success") / num_envs


@pytest.mark.parametrize("world", ["stack", "push", "open_drawer", "close_drawer"])
def test_it_is_solved_on_mujoco(world: str) -> None:
    assert solved(world, "mujoco", 4) == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
@pytest.mark.parametrize("world", ["stack", "push", "open_drawer", "close_drawer"])
def test_it_is_solved_on_the_other_engines(world: str, engine: str) -> None:
    assert solved(world, engine, 4) >= 0.75


@pytest.mark.slow
def test_a_door_is_opened_along_its_arc() -> None:
    assert solved("open_door", "mujoco", 8) >= 0.75


def given_up(world: str, *overrides: str) -> tuple[list[Outcome], dict[str, object]]:
    """The outcomes of two envs, and what the first one says."""
    with make(WORLDS / f"{world}.yaml", engine="mujoco", num_envs=2, overrides=overrides) as env:
        env.reset(seed=11)
        policy = SkillPolicy(env)
        rollout(env, policy, STEPS)
        assert policy.gave_up(np.arange(2)).all()
        return [OUTCOMES[o] for o in policy.skill.outcome], policy.describe(0)


def test_a_handle_out_of_reach_is_no_ik() -> None:
    away = ("position=[1.4, 0.0, 0.4]", "on=null", "x=null", "y=null")
    outcomes, said = given_up("open_drawer", *(f"world.layout.cabinet.{value}" for value in away))
    assert outcomes == [Outcome.NO_IK] * 2
    assert said["ladder"]


def test_a_locked_drawer_is_not_called_open() -> None:
    outcomes, said = given_up("open_drawer", "world.objects.cabinet.source.params.drawer_friction=2000.0")
    assert outcomes == [Outcome.JAMMED] * 2
    assert said["ladder"] == ["jammed -> back_off", "jammed -> give up"]

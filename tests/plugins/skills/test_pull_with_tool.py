"""Pull with a tool: a hook is grasped, and draws a cube nearer that the hand does not reach."""

from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.math import pose as P
from anysim.skills.base import Outcome
from anysim.testing.engines import require_engine
from tests.plugins.skills.test_navigate import driven
from tests.tiers import others

WORLD = Path(__file__).parent / "worlds/pull_with_tool.yaml"
NUM_ENVS = 4


def pulled(engine: str, *overrides: str) -> tuple[list[Outcome], np.ndarray]:
    """The outcomes, and how far [m] the cubes are from the goal in the end."""
    require_engine(engine)
    with make(WORLD, engine=engine, num_envs=NUM_ENVS, overrides=overrides) as env:
        outcomes = driven(env, 950)
        env.scene.look(None)
        off = env.scene.frame("cube").position[:, :2] - env.scene.frame("spot").position[:, :2]
        return outcomes, P.norm(off)


def test_a_cube_is_drawn_to_the_goal_with_a_hook() -> None:
    outcomes, off = pulled("mujoco")
    assert outcomes == [Outcome.OK] * NUM_ENVS
    assert (off < 0.045).all()


@pytest.mark.parametrize("engine", others("sapien"))
def test_it_is_drawn_on_the_other_engines(engine: str) -> None:
    outcomes, off = pulled(engine)
    assert outcomes.count(Outcome.OK) >= 3
    assert (off < 0.045).sum() >= 3


def test_what_the_hook_does_not_reach_is_no_ik() -> None:
    outcomes, off = pulled("mujoco", "world.objects.table.source={box: [2.2, 1.4, 0.4]}", "world.layout.cube.x=1.2")
    assert outcomes == [Outcome.NO_IK] * NUM_ENVS
    assert (off > 0.5).all()

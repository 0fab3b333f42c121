"""The skill drag on real engines: an object slid to its goal, without being lifted, and one that cannot get there."""

import numpy as np
import pytest

from anysim import make
from anysim.skills.base import Outcome
from anysim.skills.runner import SkillPolicy
from tests.plugins.skills.test_honest_failures import given_up
from tests.plugins.skills.test_manipulation import WORLDS, solved

ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]


def test_an_object_is_dragged_to_its_goal_on_mujoco_and_never_lifted() -> None:
    with make(WORLDS / "drag.yaml", engine="mujoco", num_envs=4) as env:
        env.reset(seed=11)
        policy, ids = SkillPolicy(env), np.arange(4)
        policy.begin(ids)
        cube, highest = env.engine.index.body("cube"), 0.0
        while env.running.any():
            env.step(policy.act(np.flatnonzero(env.running)), env.running)
            highest = max(highest, float(env.engine.get_state().body_pose[:, cube, 2].max()))
        assert (env.status == "success").all()
        assert highest < 0.42 + 0.006  # its centre on the table


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_an_object_is_dragged_to_its_goal_on_the_other_engines(engine: str) -> None:
    assert solved("drag", engine, 4) >= 0.75


def test_one_that_a_wall_keeps_from_its_goal_is_jammed() -> None:
    wall = "world.objects.wall={source: {box: [0.02, 0.6, 0.1]}, fixed: true, friction: 0.2}"
    place = ("world.layout.wall={position: [0.44, 0.0, 0.45]}", "world.layout.cube.x=0.36", "world.layout.cube.y=0.0")
    goal = ("task.command.goal.x=0.28", "task.command.goal.y=0.0", "task.horizon=900")
    outcomes, _ = given_up("drag", wall, *place, *goal)
    assert set(outcomes) <= {Outcome.JAMMED, Outcome.UNSTABLE_GRASP}


@pytest.mark.parametrize("engine", ENGINES)
def test_a_plate_that_no_gripper_spans_is_dragged_by_fingers_pressed_onto_it(engine: str) -> None:
    assert solved("drag_down", engine, 4) >= 0.75


def test_fingers_that_slip_on_a_plate_have_lost_it() -> None:
    """Its support holds the plate better than the fingers do."""
    outcomes, _ = given_up("drag_down", "world.objects.table.friction=4.0", "task.horizon=2000")
    assert set(outcomes) == {Outcome.LOST}

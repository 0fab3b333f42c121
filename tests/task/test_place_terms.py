"""Predicates of places, tilt and motion, and goals beside things, against poses that were set."""

from typing import Any

import numpy as np
import pytest

from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.task.terms import predicates
from tests.task.helpers import blocks


def put(env: TaskEnv, name: str, position: Any, turn: Any = (0.0, 0.0, 0.0), twist: Any = (0,) * 6) -> None:
    """Put an object of all envs somewhere: position, roll-pitch-yaw, twist."""
    quaternion = P.from_roll_pitch_yaw(np.array(turn, dtype=float))
    pose = np.concatenate([np.array(position, dtype=float), quaternion])
    n, root = env.num_envs, env.engine.index.entity(name).root
    env.engine.set_body_state(np.tile(pose, (n, 1, 1)), np.tile(np.array(twist, float), (n, 1, 1)), None, [root])
    env.scene.look(None)


@pytest.mark.parametrize(
    ("shift", "said"),
    [
        ((0, 0, 0.05), True),
        ((0.019, 0, 0.05), True),
        ((0.021, 0, 0.05), False),
        ((0, 0, 0.057), False),
        ((0, 0, 0.043), False),
    ],
)
def test_above_is_a_height_over_something_and_not_beside_it(shift: Any, said: bool) -> None:
    with blocks() as env:
        env.reset(seed=0)
        put(env, "red", (0.1, 0.2, 0.425))
        put(env, "ball", np.array([0.1, 0.2, 0.425]) + shift)
        a, b = env.scene.frame("ball"), env.scene.frame("red")
        assert predicates.above(env.scene, a=a, b=b, height=0.05, tolerance=0.005, distance=0.02).tolist() == [said]


def test_inside_is_in_the_axes_of_the_other() -> None:
    with blocks() as env:
        env.reset(seed=0)
        put(env, "red", (0.0, 0.0, 0.5), (0.0, 0.0, np.pi / 2))
        a, b = env.scene.frame("ball"), env.scene.frame("red")
        for position, said in (((0.0, 0.08, 0.5), True), ((0.08, 0.0, 0.5), False), ((0.0, 0.08, 0.52), False)):
            put(env, "ball", position)
            found = predicates.inside(env.scene, a=a, b=b, low=(-0.1, -0.01, -0.01), high=(0.1, 0.01, 0.01))
            assert found.tolist() == [said]


def test_upright_is_a_limit_of_the_tilt_and_not_of_the_yaw() -> None:
    with blocks() as env:
        env.reset(seed=0)
        for turn, said in (((0.09, 0, 2.0), True), ((0, 0.11, 0), False), ((np.pi, 0, 0), False)):
            put(env, "red", (0, 0, 0.5), turn)
            assert predicates.upright(env.scene, frame=env.scene.frame("red"), tolerance=0.1).tolist() == [said]


def test_still_is_a_limit_of_the_speed_and_of_the_rate() -> None:
    with blocks() as env:
        env.reset(seed=0)
        slow, fast, turning = (0.009, 0, 0, 0, 0, 0.4), (0.011, 0, 0, 0, 0, 0), (0, 0, 0, 0, 0.6, 0)
        for twist, said in ((slow, True), (fast, False), (turning, False)):
            put(env, "red", (0, 0, 0.5), twist=twist)
            assert predicates.still(env.scene, frame=env.scene.frame("red")).tolist() == [said]


def test_a_goal_beside_a_thing_is_as_far_and_in_the_direction_that_was_drawn() -> None:
    draws = "distance: {range: [0.2, 0.3]}, direction: {range: [1, 2]}"
    goal = f"task.command.beside={{term: goal_beside, frame: red, {draws}}}"
    with blocks(8, goal) as env:
        env.reset(seed=0)
        apart = env.scene.goals["beside"][:, :3] - env.scene.frame("red").position
        far, angle = np.hypot(apart[:, 0], apart[:, 1]), np.arctan2(apart[:, 1], apart[:, 0])
        assert not apart[:, 2].any()
        assert ((far >= 0.2) & (far <= 0.3) & (angle >= 1) & (angle <= 2)).all()
        assert np.ptp(far) > 0.01

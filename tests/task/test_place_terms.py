"""Predicates of places, tilt and motion, and goals beside things, against poses that were set."""

from typing import Any

import numpy as np
import pytest

from anysim.errors import NameLookupError, TaskError
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.task.term_registry import bind
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


def term(env: TaskEnv, kind: str, name: str, **params: Any) -> Any:
    """What a term says now."""
    return bind(kind, name, params, env.scene, "test")()


def test_near_and_distance_along_axes_of_the_world_or_of_a_frame() -> None:
    with blocks() as env:
        env.reset(seed=0)
        put(env, "red", (0.0, 0.0, 0.5), (0.0, 0.0, np.pi / 2))  # its x is the world's y
        put(env, "ball", (0.3, 0.4, 0.7))
        both = {"a": "red", "b": "ball"}
        for axes, far in (("xyz", np.sqrt(0.29)), ("xy", 0.5), ("x", 0.3), ("yz", np.sqrt(0.2))):
            assert term(env, "reward", "distance", **both, axes=axes) == pytest.approx(far)
            assert term(env, "reward", "tanh_distance", **both, axes=axes) == pytest.approx(1 - np.tanh(far / 0.1))
        assert term(env, "reward", "distance", **both) == pytest.approx(np.sqrt(0.29))
        for frame, axes, said in (("world", "x", True), ("a", "x", False), ("a", "y", True), ("b", "x", True)):
            found = term(env, "predicate", "near", **both, tolerance=0.35, axes=axes, frame=frame)
            assert found.tolist() == [said], (frame, axes)


@pytest.mark.parametrize(
    ("yaw", "symmetry", "turn"), [(0.3, 1, 0.3), (2.0, 4, 2.0 - np.pi / 2), (-3.0, 2, np.pi - 3.0)]
)
def test_a_relative_rotation_is_to_the_nearest_of_what_looks_alike(yaw: float, symmetry: int, turn: float) -> None:
    with blocks() as env:
        env.reset(seed=0)
        put(env, "red", (0, 0, 0.5), (np.pi / 2, 0.0, 0.0))
        put(env, "ball", (0, 0, 0.6), (np.pi / 2, 0.0, 0.0))
        quaternion = P.multiply(
            env.scene.frame("red").quaternion[0], P.from_axis_angle(np.array([0, 0, 1.0]), np.array(yaw))
        )
        pose = np.concatenate([[0.0, 0.0, 0.6], quaternion])
        env.engine.set_body_state(pose[None, None], np.zeros((1, 1, 6)), None, [env.engine.index.entity("ball").root])
        env.scene.look(None)
        found = term(env, "observation", "relative_rotation", a="red", b="ball", symmetry=symmetry)
        np.testing.assert_allclose(found, [[0.0, 0.0, turn]], atol=1e-9)


def test_points_are_compared_one_by_one() -> None:
    with blocks() as env:
        env.reset(seed=0)
        put(env, "red", (0.0, 0.0, 0.5), (0.0, 0.0, np.pi / 2))
        put(env, "ball", (0.03, 0.0, 0.5))
        env.scene.goals["goal"][:] = [0.03, 0.05, 0.5, 0, 0, 0, 1]
        env.scene.moment += 1
        seen = term(env, "observation", "points", points=["ball", "goal"], frame="red")
        np.testing.assert_allclose(seen, [[0.0, -0.03, 0.0, 0.05, -0.03, 0.0]], atol=1e-12)
        some = {"a": ["ball", "red"], "b": ["goal", "ball"]}  # 5 and 3 cm apart
        for mean, most, said in (
            (0.041, None, True),
            (0.039, None, False),
            (0.041, 0.049, False),
            (0.041, 0.051, True),
        ):
            assert term(env, "predicate", "points_near", **some, mean=mean, most=most).tolist() == [said]


def test_a_camera_sees_what_is_in_its_image_at_its_distance() -> None:
    with blocks() as env:
        env.reset(seed=0)
        put(env, "red", (0.0, 0.0, 0.5))
        eye = np.concatenate([[0.0, -1.0, 0.5], P.look_at(np.array([0.0, -1.0, 0.5]), np.array([0.0, 0.0, 0.5]))])
        env.engine.set_camera_pose("eye", eye[None])
        view = env.engine.camera_view("eye")
        half = float(np.tan(np.radians(view.fov[0]) / 2))  # of the image's height, 1 m away
        wide = half * view.width / view.height
        sees = {"camera": "eye", "object": "red"}
        for x, z, said, central in (
            (0.0, 0.0, True, True),
            (0.95 * wide, 0.0, True, False),
            (1.05 * wide, 0.0, False, False),
            (0.0, 0.95 * half, True, False),
            (0.0, -1.05 * half, False, False),
            (0.19 * wide, 0.19 * half, True, True),
        ):
            put(env, "red", (x, 0.0, 0.5 + z))
            assert term(env, "predicate", "visible", **sees).tolist() == [said], (x, z)
            assert term(env, "predicate", "visible", **sees, within=0.2).tolist() == [central], (x, z)
        put(env, "red", (0.0, -1.5, 0.5))  # behind it
        assert term(env, "predicate", "visible", **sees).tolist() == [False]
        put(env, "red", (0.0, 0.0, 0.5))
        for nearest, farthest, said in ((0.9, 1.1, True), (1.1, 1.5, False), (0.5, 0.9, False)):
            assert term(env, "predicate", "visible", **sees, nearest=nearest, farthest=farthest).tolist() == [said]
        with pytest.raises(TaskError, match=r"needs segmentation; add it to world\.cameras\.eye\.channels"):
            term(env, "predicate", "visible", **sees, pixels=5)
        with pytest.raises(NameLookupError, match="no camera named 'ey'; did you mean 'eye'"):
            term(env, "predicate", "visible", camera="ey", object="red")

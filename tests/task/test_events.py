"""Events act through the engine, on their own envs, and are part of an episode that can be drawn again."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.task.env import TaskEnv
from anysim.task.term_registry import bind
from anysim.testing.engines import require_engine
from tests.task.helpers import arm, blocks

PUSH = "task.events={shove: {term: push, when: step, object: cube, force: {range: [[-2, -2, 0], [2, 2, 0]]}, every: 5}}"
SLICK = "task.events={slick: {term: set_friction, object: cube, friction: {range: [0.1, 0.3]}}}"


def positions(env: TaskEnv, steps: int) -> np.ndarray:
    cube = env.engine.index.body("cube")
    rows = []
    for _ in range(steps):
        env.step(np.zeros((env.num_envs, env.action_dim)))
        rows.append(env.engine.get_state().body_pose[:, cube].copy())
    return np.array(rows)


def test_pushes_move_the_object_and_are_drawn_again() -> None:
    with arm(2, PUSH, engine="mujoco") as env:
        _, info = env.reset(seed=0)
        start = env.engine.get_state().body_pose[:, env.engine.index.body("cube"), :2].copy()
        first = positions(env, 20)
        assert np.linalg.norm(first[-1, :, :2] - start, axis=1).max() > 0.003
        env.reset(episode_seeds=info["episode_seed"])
        assert (positions(env, 20) == first).all()


def test_a_snapshot_may_be_taken_while_a_push_waits_for_its_step() -> None:
    with arm(1, PUSH, engine="mujoco") as env:
        env.reset(seed=0)
        positions(env, 5)
        snapshot = env.snapshot()
        direct = positions(env, 10)
        env.reset_to(snapshot)
        assert (positions(env, 10) == direct).all()


def test_friction_is_set_at_reset_and_noted() -> None:
    with arm(3, SLICK, engine="mujoco") as env:
        env.reset(seed=0)
        geoms = env.engine.index.geoms_of(env.engine.index.entity("cube"))
        friction = env.engine.get_parameters("geom.friction", indices=geoms)[:, 0]
        assert ((friction >= 0.1) & (friction <= 0.3)).all()
        assert np.allclose([d["task/event/slick/friction"] for d in env.streams.draws], friction)


SEEN: dict[str, Any] = {
    "world": {
        "name": "seen",
        "objects": {
            "floor": {"source": {"box": [2.0, 2.0, 0.1]}, "fixed": True},
            "ball": {"source": {"sphere": 0.1}, "color": "red"},
            "screen": {"source": {"box": [0.02, 0.5, 0.5]}, "fixed": True},
        },
        "layout": {
            "floor": {"position": [0.0, 0.0, 0.0]},
            "ball": {"position": [0.0, 0.0, 0.15]},
            "screen": {"position": [0.5, 0.0, 0.3]},
        },
        "cameras": {
            "eye": {
                "from": [1.0, 0.0, 0.3],
                "look_at": [0.0, 0.0, 0.15],
                "size": [64, 48],
                "channels": ["segmentation"],
            }
        },
    },
    "task": {"horizon": 9, "observations": {"policy": [{"term": "frame_pose", "frame": "ball"}]}},
}
ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]


@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_hidden_is_not_seen_and_what_hid_it_is_seen_through(engine: str) -> None:
    require_engine(engine)
    hiding = {"screen": {"term": "visibility", "object": "screen", "visible": {"choice": [0, 1]}}}
    task = {**SEEN["task"], "events": hiding}
    with anysim.make({**SEEN, "engine": engine, "task": task}, num_envs=8) as env:
        sees, in_image = (
            bind("predicate", "visible", {"camera": "eye", "object": "ball", "pixels": pixels}, env.scene, "t")
            for pixels in (50, 0)
        )
        env.reset(seed=0)
        drawn = np.array([draws["task/event/screen/visible"] for draws in env.streams.draws])
        assert set(drawn) == {0, 1}
        env.step(np.zeros((8, 0)))
        assert (sees() == (drawn == 0)).all()
        assert in_image().all(), "it is in the image, behind the screen"
        bind("event", "visibility", {"object": "ball"}, env.scene, "t")(lambda name, value: np.zeros(8))
        env.step(np.zeros((8, 0)))
        assert not sees().any()


def test_a_goal_goes_along_its_path_at_its_speed() -> None:
    corners = "[[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]]"
    speed = "speed: {range: [0.5, 1.0]}"
    goals = (
        f"task.command.open={{term: goal_path, path: {corners}, speed: 0.5}}",
        f"task.command.closed={{term: goal_path, path: {corners}, frame: table, closed: true, {speed}}}",
    )
    with blocks(4, *goals, "task.horizon=100", "task.success={}", "task.failure={}") as env:
        env.reset(seed=0)
        dt = env.engine.world.physics.control_dt
        speed = np.array([draws["task/command/closed/speed"] for draws in env.streams.draws])
        top = env.scene.frame("table").position
        length = 0.2 + np.sqrt(0.02)

        def along(far: np.ndarray) -> np.ndarray:
            x = np.where(far < 0.1, far, np.where(far < 0.2, 0.1, 0.1 - (far - 0.2) / np.sqrt(2)))
            y = np.where(far < 0.1, 0.0, np.where(far < 0.2, far - 0.1, 0.1 - (far - 0.2) / np.sqrt(2)))
            return np.stack([x, y, np.zeros_like(x)], axis=1)

        for step in range(50):
            if step == 20:
                middle = env.snapshot()
            far = step * dt * speed % length
            np.testing.assert_allclose(env.scene.goals["closed"][:, :3], top + along(far), atol=1e-9)
            still = along(np.full(4, min(step * dt * 0.5, 0.2)))
            np.testing.assert_allclose(env.scene.goals["open"][:, :3], still, atol=1e-9)
            env.step(np.zeros((4, 0)))
        env.reset(seed=1)
        env.reset_to(middle)
        env.step(np.zeros((4, 0)))
        np.testing.assert_allclose(env.scene.goals["closed"][:, :3], top + along(21 * dt * speed % length), atol=1e-9)

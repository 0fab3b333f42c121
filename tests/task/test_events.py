"""Events act through the engine, on their own envs, and are part of an episode that can be drawn again."""

import numpy as np

from anysim.task.env import TaskEnv
from tests.task.helpers import arm

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

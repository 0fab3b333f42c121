"""Bolt keeps stepping on its point feet, on the spot and at a commanded velocity, on every engine."""

import numpy as np
import pytest

from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.testing.quadrupeds import made

ENGINES = ("mujoco", "pybullet", "sapien")
ASKED = np.array([[0.0, 0.0], [0.2, 0.0], [-0.2, 0.0], [0.0, 0.1], [0.0, -0.1]])
SIDES = {"mujoco": (0, 3, 6), "pybullet": (1, 4, 7), "sapien": (2, 5)}
"""From which of eight sides it is often pushed: between them the engines have all."""
ALL = tuple(range(8))


def base(env: TaskEnv) -> np.ndarray:
    """Poses (N, 7) of the trunks."""
    return np.array(env.engine.get_state().body_pose[:, env.engine.index.entity("robot").root])


def walked(env: TaskEnv, asked: np.ndarray, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean velocity (N, 2) in the heading frame, and the largest tilt (N,) [rad], while it steps."""
    poses = [base(env)]
    for _ in range(round(seconds / 0.02)):
        env.step(asked)
        poses.append(base(env))
    path = np.array(poses)
    ahead = P.rotate(path[..., 3:], np.broadcast_to([1.0, 0.0, 0.0], (*path.shape[:2], 3)))[..., :2]
    ahead /= np.linalg.norm(ahead, axis=-1, keepdims=True)
    moved = np.diff(path[..., :2], axis=0)
    forward = (moved * ahead[:-1]).sum(axis=-1).sum(axis=0)
    left = (moved[..., 1] * ahead[:-1, :, 0] - moved[..., 0] * ahead[:-1, :, 1]).sum(axis=0)
    up = P.rotate(path[..., 3:], np.broadcast_to([0.0, 0.0, 1.0], (*path.shape[:2], 3)))[..., 2]
    return np.stack([forward, left], axis=1) / seconds, np.arccos(np.clip(up, -1.0, 1.0)).max(axis=0)


@pytest.mark.parametrize(
    ("engine", "asked"),
    [
        pytest.param("mujoco", ASKED[[0, 1, 4]], id="mujoco-some", marks=pytest.mark.slow),
        *(pytest.param(engine, ASKED, id=engine, marks=pytest.mark.full) for engine in ENGINES),
    ],
)
def test_it_steps_on_the_spot_and_as_commanded(engine: str, asked: np.ndarray) -> None:
    with made("bolt", engine, len(asked)) as env:
        env.reset(seed=0)
        walked(env, asked, 2.0)
        velocity, tilt = walked(env, asked, 8.0)
        height = base(env)[:, 2]
    print(f"{engine}: {velocity.round(3).tolist()} m/s, tilts of up to {np.rad2deg(tilt.max()):.1f} degrees")
    assert (np.abs(height - 0.345) < 0.02).all(), "none fell in ten seconds"
    assert np.rad2deg(tilt.max()) < 12.0
    assert np.abs(velocity - asked).max() < 0.04


@pytest.mark.parametrize(
    ("engine", "sides"),
    [
        *(pytest.param(*row, id=f"{row[0]}-some", marks=pytest.mark.slow) for row in SIDES.items()),
        *(pytest.param(engine, ALL, id=engine, marks=pytest.mark.full) for engine in ENGINES),
    ],
)
def test_it_steps_on_after_pushes_from_eight_sides(engine: str, sides: tuple[int, ...]) -> None:
    with made("bolt", engine, len(sides)) as env:
        env.reset(seed=0)
        still, root = np.zeros((len(sides), 2)), env.engine.index.entity("robot").root
        walked(env, still, 1.0)
        state = env.engine.get_state()
        pose, twist = state.body_pose[:, [root]].copy(), state.body_twist[:, [root]].copy()
        side = np.array(sides) * np.pi / 4.0
        twist[:, 0, :2] += 0.3 * np.stack([np.cos(side), np.sin(side)], axis=1)
        env.engine.set_body_state(pose, twist, np.arange(len(sides)), [root])
        walked(env, still, 2.5)
        height = base(env)[:, 2]
    print(f"{engine}: {height.round(3)} m high")
    assert (np.abs(height - 0.345) < 0.02).all()


def test_a_snapshot_of_a_step_continues_bit_for_bit() -> None:
    with made("bolt", "mujoco", 2) as env:
        env.reset(seed=0)
        asked = np.array([[0.1, 0.0], [0.1, 0.0]])
        walked(env, asked, 0.5)
        saved = env.snapshot()
        walked(env, asked, 0.4)
        once = np.array(env.engine.get_state().joint_pos)
        env.reset_to(saved)
        walked(env, asked, 0.4)
        assert (env.engine.get_state().joint_pos == once).all()
        assert (once[0] == once[1]).all(), "a row does not depend on its place"

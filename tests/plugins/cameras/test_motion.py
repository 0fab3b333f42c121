"""The camera that flies: limits of its motions, where it arrives, what it looks at, and the image from it."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim_cameras.easing import minimum_jerk, move_time
from tests.runtime.light import REAL

DT = 0.004


def flight(engine: str, n: int = 1, base: Any = "default", arm: Any = "default", **robot: Any) -> TaskEnv:
    """A camera above a ball and a post."""
    spec = {
        "engine": engine,
        "physics": {"dt": DT, "control_dt": 0.02},
        "world": {
            "name": "flight",
            "robots": {"cam": {"robot": "flying_camera", "position": [0, 0, 2], "actions": {"base": base, "arm": arm},
                               **robot}},
            "objects": {"ball": {"source": {"sphere": 0.25}, "color": "red"},
                        "post": {"source": {"box": [0.1, 0.1, 1.0]}, "fixed": True, "color": "blue"}},
            "layout": {"ball": {"position": [2.0, 0.5, 0.25]}, "post": {"position": [3, 0, 0.5]}},
            "cameras": {"eye": {"mount": "cam.camera", "size": [64, 48], "fov": 60}},
        },
        "task": {"horizon": 10000, "observations": {"policy": ["joint_pos", "joint_vel"]}},
        "record": {"cameras": []},
    }  # fmt: skip
    if engine == "null":
        spec["world"]["cameras"]["eye"]["channels"] = []  # type: ignore[index]
    return anysim.make(spec, num_envs=n)


def controllers(env: TaskEnv) -> tuple[Any, Any]:
    return env.actions.slices[0].controller, env.actions.slices[1].controller


def test_minimum_jerk_is_as_fast_as_the_limits_allow() -> None:
    u = np.linspace(0.0, 1.0, 20001)
    done, pace = minimum_jerk(u)
    assert done[0] == 0.0
    assert done[-1] == pytest.approx(1.0)
    assert np.allclose(np.gradient(done, u), pace, atol=1e-3)
    for length, speed, acceleration in ((3.0, 2.0, 4.0), (0.1, 2.0, 4.0), (10.0, 1.0, 100.0)):
        time = float(move_time(np.array(length), speed, acceleration))
        peak = pace.max() * length / time / speed
        push = np.abs(np.gradient(pace, u)).max() * length / time**2 / acceleration
        assert max(peak, push) == pytest.approx(1.0, abs=1e-3), "one of the two limits is reached, none is passed"
        assert min(peak, push) < 1.0


@pytest.mark.parametrize(
    "base",
    [
        {"controller": "camera_motion"},
        {"controller": "camera_motion", "params": {"command": "pose"}},
        {"controller": "camera_motion", "params": {"command": "pose", "easing": "damped"}},
    ],
    ids=["velocity", "minimum_jerk", "damped"],
)
def test_no_command_whatever_passes_the_limits(base: Any) -> None:
    """Random commands, most of them far beyond what can be done: speed and acceleration of what is commanded."""
    params = {**base.get("params", {}), "speed": 1.5, "acceleration": 3.0}
    with flight("null", 5, {**base, "params": params}) as env:
        env.reset(seed=0)
        motion = controllers(env)[0]
        rng = np.random.default_rng(3)
        places, rates = [np.zeros((5, 3))], []
        for step in range(400):
            if step % 20 == 0:
                action = rng.uniform(motion.low, motion.high, (5, 3)) * (0.05 if step % 60 == 0 else 1.0)
            for command in [motion.apply(action, None), *(motion.update(None) for _ in range(4))]:
                places.append(command.position)
                rates.append(command.velocity)
        velocity = np.diff(np.array(places), axis=0) / DT
        speed = P.norm(velocity)
        acceleration = P.norm(np.diff(velocity, axis=0)) / DT
        assert speed.max() <= 1.5 * (1 + 1e-9)
        assert speed.max() > 1.4, "the limit is used"
        assert acceleration.max() <= 3.0 * (1 + 1e-6)
        assert acceleration.max() > 2.5
        assert P.norm(np.array(rates)).max() <= 1.5 * (1 + 1e-9)


def test_velocities_end_at_the_joints_limits() -> None:
    with flight("null", 1, {"controller": "camera_motion", "params": {"speed": 5.0, "acceleration": 3.0}}) as env:
        env.reset(seed=0)
        motion = controllers(env)[0]
        places = [np.zeros((1, 3))]
        for _ in range(3000):
            command = motion.update(None) if len(places) % 5 else motion.apply(motion.high[None], None)
            places.append(command.position)
        velocity = np.diff(np.array(places), axis=0) / DT
        assert np.abs(np.array(places)).max() <= 20.0
        assert np.abs(places[-1] - 20.0).max() < 0.05
        assert P.norm(np.diff(velocity, axis=0)).max() / DT <= 3.0 * (1 + 1e-6)


@pytest.mark.parametrize("engine", REAL)
@pytest.mark.parametrize("easing", ["minimum_jerk", "damped"])
def test_it_arrives_and_stays(engine: str, easing: str) -> None:
    base = {"controller": "camera_motion", "params": {"command": "pose", "easing": easing}}
    with flight(engine, 2, base) as env:
        env.reset(seed=0)
        there = np.array([[1.0, -0.5, 0.5], [0.0, 0.0, -1.0]])
        action = np.concatenate([there, np.zeros((2, 2))], axis=1)
        fastest = 0.0
        for _ in range(140):
            env.step(action)
            fastest = max(fastest, float(P.norm(env.engine.get_state().joint_vel[:, :3]).max()))
        state = env.engine.get_state()
        assert np.abs(state.joint_pos[:, :3] - there).max() < 1e-3
        assert np.abs(state.joint_vel).max() < 5e-3
        assert fastest < 2.0 * 1.02


@pytest.mark.parametrize("engine", REAL)
def test_the_gimbal_looks_at_what_moves_while_it_flies(engine: str) -> None:
    """Flying past at 1 m/s: the optical axis stays on the ball within a degree, the horizon level."""
    with flight(engine, 1, arm={"controller": "camera_gimbal", "params": {"look_at": "ball"}}) as env:
        env.reset(seed=0)
        action = np.array([[0.4, 0.9, 0.0, 0.0, 0.0]])
        for step in range(120):
            env.step(action)
            state = env.engine.get_state()
            frame, ball = env.scene.frame("cam.camera"), env.scene.frame("ball")
            ahead = P.rotate(frame.quaternion, np.array([[0.0, 0.0, 1.0]]))[0]
            right = P.rotate(frame.quaternion, np.array([[1.0, 0.0, 0.0]]))[0]
            way = (ball.position - frame.position)[0]
            off = np.degrees(np.arccos(np.clip(ahead @ way / np.linalg.norm(way), -1, 1)))
            assert abs(right[2]) < 1e-3, "level"
            if step > 50:
                assert off < 1.0
        assert not state.fault.any()


def test_the_gimbal_keeps_its_limits_when_it_flies_over_what_it_looks_at() -> None:
    arm = {"controller": "camera_gimbal", "params": {"look_at": [1.0, 0.01, 0.0], "rate": 2.0, "acceleration": 5.0}}
    with flight("mujoco", 1, arm=arm) as env:
        env.reset(seed=0)
        gimbal = controllers(env)[1]
        angles = []
        for _ in range(150):
            env.step(np.array([[1.0, 0.0, 0.0, 0.0, 0.0]]))
            angles.append(gimbal.snapshot(np.array([0]))["velocity"][0])
        rates = np.array(angles)
        assert 1.0 < np.abs(rates).max() <= 2.0
        assert np.abs(np.diff(rates, axis=0)).max() <= 5.0 * 0.02 + 1e-9
        assert np.ptp(rates[:, 2]) > 1.0, "the roll levels the view on the other side"


@pytest.mark.parametrize("engine", REAL)
def test_a_camera_mounted_on_it_sees_what_it_looks_at(engine: str) -> None:
    with flight(engine, 1, arm={"controller": "camera_gimbal", "params": {"look_at": "ball"}}) as env:
        env.reset(seed=0)
        for _ in range(60):
            env.step(np.zeros((1, 5)))
        image = env.render("eye")[0].astype(int)
        red = (image[..., 0] - image[..., 1:].max(axis=-1)) > 60
        assert red.sum() > 20
        rows, columns = np.nonzero(red)
        assert abs(rows.mean() - 23.5) < 2.0
        assert abs(columns.mean() - 31.5) < 2.0


def test_snapshots_hold_moves_under_way() -> None:
    base = {"controller": "camera_motion", "params": {"command": "pose"}}
    arm = {"controller": "camera_gimbal", "params": {"look_at": "ball"}, "delay": 2}
    with flight("mujoco", 3, base, arm) as env:
        env.reset(seed=0)
        rng = np.random.default_rng(0)
        actions = rng.uniform(-1, 1, (30, 3, 5))
        for row in actions[:9]:
            env.step(row)
        kept = env.snapshot()
        first = [env.step(row).obs["policy"] for row in actions[9:]]
        env.reset(seed=5)
        env.reset_to(kept)
        assert all(np.array_equal(env.step(r).obs["policy"], f) for r, f in zip(actions[9:], first, strict=True))


@pytest.mark.parametrize(
    ("arm", "words"),
    [
        ({"controller": "camera_gimbal", "params": {"look_at": "bal"}}, "look_at: .*'bal'"),
        ({"controller": "camera_motion", "params": {"command": "place"}}, "command"),
    ],
)
def test_what_is_wrong_is_said(arm: Any, words: str) -> None:
    with pytest.raises(AnysimError, match=words):
        flight("null", 1, arm=arm)


def test_a_gimbal_needs_three_axes() -> None:
    with pytest.raises(AnysimError, match="three turning joints"):
        flight("null", 1, "camera_gimbal")

"""An inertial unit against motion whose answer is known."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.math import pose as P
from anysim.testing.engines import require_engine

G = 9.81
TURNING = Path(__file__).parent / "turning.yaml"
ENGINES = ("mujoco", "pybullet", "sapien")


def world(engine: str, control_dt: float = 0.02, height: float = 5.0, **more: Any) -> dict[str, Any]:
    """A box with a unit on it."""
    return {
        "engine": engine,
        "physics": {"dt": control_dt / 10, "control_dt": control_dt, **more},
        "world": {
            "objects": {"box": {"source": {"box": [0.2, 0.2, 0.1]}, "mass": 1.0}},
            "layout": {"box": {"position": [0.0, 0.0, height]}},
            "sensors": {"imu": {"sensor": "imu", "frame": "box"}},
        },
        "task": {"horizon": 5000, "observations": {"policy": [{"term": "sensor", "of": "imu"}]}},
    }


@pytest.mark.parametrize("engine", ENGINES)
def test_it_reads_nothing_in_free_fall_and_gravity_at_rest(engine: str) -> None:
    require_engine(engine)
    with anysim.make(world(engine, height=0.6), num_envs=2) as env:
        env.reset(seed=0)
        still = np.zeros((2, 0))
        for _ in range(10):  # 0.2 s: 0.2 m
            env.step(still)
            assert np.abs(env.sensors.reading("imu", "acceleration")).max() < 1e-4
        for _ in range(150):
            env.step(still)
        resting = env.sensors.reading("imu", "acceleration")
        assert resting == pytest.approx(np.tile([0, 0, G], (2, 1)), abs=2e-3)
        assert np.abs(env.sensors.reading("imu", "angular_velocity")).max() < 1e-3


def moving(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pose, twist and acceleration of a frame that goes round a circle, up and down, and turns about two axes."""
    radius, round_, up, spin = 0.4, 2.0, 3.0, np.array([0.5, 0.2, 1.5])
    c, s = np.cos(round_ * t), np.sin(round_ * t)
    position = np.array([radius * c, radius * s, 0.1 * np.sin(up * t)])
    velocity = np.array([-radius * round_ * s, radius * round_ * c, 0.1 * up * np.cos(up * t)])
    acceleration = np.array([-radius * round_**2 * c, -radius * round_**2 * s, -0.1 * up**2 * np.sin(up * t)])
    turn = P.from_rotation_vector(spin * t)
    return np.concatenate([position, turn]), np.concatenate([velocity, spin]), acceleration


def errors(control_dt: float) -> tuple[float, float]:
    """The largest errors [m/s^2, rad/s] on that motion, prescribed to the engine without forces."""
    spec = world("null", control_dt)
    worst = np.zeros(2)
    with anysim.make(spec) as env:
        env.reset(seed=0)
        box = [env.engine.index.body("box")]
        for step in range(round(2.0 / control_dt)):
            pose, twist, _ = moving(step * control_dt)[0], *moving((step + 1) * control_dt)[1:]
            env.engine.set_body_state(pose[None, None], twist[None, None], bodies=box)  # a step moves it by its twist
            env.step(np.zeros((1, 0)))
            time = float(env.sensors.reading("imu", "time")[0])
            if step == 0:  # from where the layout had it
                continue
            assert time == pytest.approx((step + 0.5) * control_dt)
            pose, twist, acceleration = moving(time)
            force = P.rotate_inverse(pose[3:], acceleration + np.array([0, 0, G]))
            rate = P.rotate_inverse(pose[3:], twist[3:])
            read = env.sensors.reading("imu", "acceleration")[0], env.sensors.reading("imu", "angular_velocity")[0]
            worst = np.maximum(worst, [np.abs(read[0] - force).max(), np.abs(read[1] - rate).max()])
    return float(worst[0]), float(worst[1])


def test_it_reads_what_the_middle_of_its_period_has() -> None:
    """Centripetal, linear and gravity together, on axes that turn; the error of the average is of second order."""
    coarse, fine = errors(0.02), errors(0.005)
    assert fine[0] < 5e-5  # of 11 m/s^2
    assert coarse[0] < 16.5 * fine[0] < 8e-4
    assert max(coarse[1], fine[1]) < 1e-9  # the rate is constant, so that its average is exact


@pytest.mark.parametrize("engine", ENGINES)
def test_an_arm_that_turns_pulls_inwards(engine: str) -> None:
    """On the tip of an arm, 0.3 m from a joint that a drive turns at 2 rad/s: w^2 r inwards."""
    require_engine(engine)
    arm = {"robot": str(TURNING), "position": [0, 0, 1], "actions": {"arm": "joint_velocity"}}
    spec = world(engine)
    spec["world"] |= {"robots": {"arm": arm}, "sensors": {"imu": "arm.tip"}}
    with anysim.make(spec) as env:
        env.reset(seed=0)
        for _ in range(100):
            env.step(np.full((1, 1), 2.0))
        assert env.engine.get_state().joint_vel[0] == pytest.approx([2.0], abs=1e-3)
        assert env.sensors.reading("imu", "angular_velocity")[0] == pytest.approx([0, 0, 2.0], abs=2e-3)
        assert env.sensors.reading("imu", "acceleration")[0] == pytest.approx([-4.0 * 0.3, 0, G], abs=5e-3)


def test_gravity_is_that_of_each_env() -> None:
    spec = world("mujoco", gravity={"choice": [[0, 0, -9.81], [0, 0, -1.62]]})
    with anysim.make(spec, num_envs=8) as env:
        env.reset(seed=3)
        first = env.sensors.reading("imu", "acceleration")[:, 2]
        drawn = -env.engine.get_parameters("world.gravity")[:, 0, 2]
        assert len(set(drawn.tolist())) == 2
        assert first == pytest.approx(drawn, abs=1e-12)

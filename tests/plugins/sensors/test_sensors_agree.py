"""One tape of actions on three engines: sensors that follow from motion read the same but for what drives differ by."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.conventions import Array
from anysim.testing.engines import require_engine

STEPS = 100
TOLERANCES = {
    "joints_position": 3e-3,
    "joints_velocity": 0.03,
    "tool_position": 6e-4,
    "tool_quaternion": 1.5e-3,
    "tool_velocity": 5e-3,
    "tool_angular_velocity": 0.03,
    "imu_acceleration": 0.07,
    "imu_angular_velocity": 0.05,
}
"""The largest differences in SI units over 2 s, twice what was measured; drives alone make them (5e-3 rad at most)."""


def spec(engine: str) -> dict[str, Any]:
    return {
        "engine": engine,
        "world": {
            "robots": {"panda": {"robot": "franka_panda", "actions": {"arm": "joint_delta_position"}}},
            "sensors": {
                "joints": {"sensor": "joints", "robot": "panda", "channel": "arm"},
                "tool": {"sensor": "tracking", "frame": "panda.tool", "relative_to": "panda"},
                "imu": {"sensor": "imu", "frame": "panda.tool"},
            },
        },
        "task": {"horizon": 500, "observations": {"policy": [{"term": "sensor", "of": "imu"}]}},
    }


def tape(engine: str) -> dict[str, Array]:
    """All readings (STEPS, …) of one tape of smooth actions."""
    with anysim.make(spec(engine)) as env:
        env.reset(seed=0)
        rows: dict[str, list[Array]] = {}
        for step in range(STEPS):
            phase = 2 * np.pi * (step / 50 + np.arange(env.action_dim) / 7)
            env.step(0.3 * np.sin(phase)[None])
            for name, values in env.sensor_rows(np.array([0])).items():
                rows.setdefault(name.removeprefix("sensor_"), []).append(values[0])
    return {name: np.array(values) for name, values in rows.items()}


@pytest.fixture(scope="module")
def reference() -> dict[str, Array]:
    require_engine("mujoco")
    return tape("mujoco")


def test_the_tape_moves(reference: dict[str, Array]) -> None:
    assert np.abs(reference["joints_velocity"]).max() > 0.5
    assert np.ptp(reference["imu_acceleration"], axis=0).max() > 2.0


@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_engines_agree(engine: str, reference: dict[str, Array]) -> None:
    require_engine(engine)
    other = tape(engine)
    found = {name: float(np.abs(other[name] - reference[name]).max()) for name in TOLERANCES}
    assert {name: value for name, value in found.items() if value > TOLERANCES[name]} == {}
    assert np.array_equal(other["imu_time"], reference["imu_time"])

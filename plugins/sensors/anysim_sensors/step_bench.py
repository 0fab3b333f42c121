"""Costs of sensors in a control step: one engine, one sensor at a time beside none at all."""

from collections.abc import Mapping
from typing import Any

import numpy as np

import anysim
from anysim.engine.factory import runnable
from anysim_sensors.bench import SensorCost, best_of

ENVS, MANY, STEPS = 16, 64, 20
SENSORS: Mapping[str, Mapping[str, Any]] = {
    "lidar of 16 x 360 rays": {
        "sensor": "lidar",
        "pattern": {"kind": "spinning", "elevations": [0.035 * i - 0.26 for i in range(16)], "columns": 360},
    },
    "planar lidar of 360 rays": {"sensor": "lidar", "pattern": {"kind": "planar", "columns": 360}},
    "heights, 187 of a table": {"sensor": "heights"},
    "heights, 187 rays": {"sensor": "heights", "source": "rays"},
    "depth of 64 x 48": {"sensor": "depth", "size": [64, 48]},
    "depth of 64 x 48, all channels": {
        "sensor": "depth",
        "size": [64, 48],
        "channels": ["depth", "normals", "instance_id", "class_id", "motion", "appeared"],
    },
    "occupancy of 60 x 60": {"sensor": "occupancy", "cell": 0.1},
    "imu": {"sensor": "imu"},
}
"""Those on a rover among twelve boxes, balls and cylinders."""


def step_costs(rounds: int = 5) -> list[SensorCost]:
    """What each sensor adds to a control step of 16 envs, and an env's share of it among 64 to that among 16.

    The engine is MuJoCo where it is installed, else the kinematic one.
    """
    engine = "mujoco" if "mujoco" in runnable() else "null"
    bare = {envs: _step(engine, None, envs, rounds) for envs in (ENVS, MANY)}
    costs = [SensorCost(f"a control step of {ENVS} envs on {engine}, no sensor", bare[ENVS] * 1e3, "ms")]
    for name, sensor in SENSORS.items():
        few, many = (max(_step(engine, sensor, envs, rounds) - bare[envs], 1e-9) for envs in (ENVS, MANY))
        share = (many / MANY) / (few / ENVS)
        costs.append(SensorCost(f"{name}: more in that step", few * 1e3, "ms"))
        costs.append(SensorCost(f"{name}: an env among {MANY} to one among {ENVS}", share, "times", 1.25, True))
    return costs


def _step(engine: str, sensor: Mapping[str, Any] | None, envs: int, rounds: int) -> float:
    """Seconds of processor time of a control step."""
    shapes: list[dict[str, Any]] = [{"box": [0.4, 0.4, 0.4]}, {"sphere": 0.2}, {"cylinder": [0.2, 0.4]}]
    objects = {f"thing{i}": {"source": shapes[i % 3], "fixed": True} for i in range(12)}
    places = {f"thing{i}": [2 * np.cos(i / 2), 2 * np.sin(i / 2), 0.3] for i in range(12)}
    world = {
        "objects": {**objects, "rover": {"source": {"box": [0.5, 0.3, 0.2]}}},
        "layout": {
            **{name: {"position": [float(v) for v in place]} for name, place in places.items()},
            "rover": {"position": [0.0, 0.0, 0.1]},
        },
        "sensors": {"it": {"frame": "rover", **sensor}} if sensor else {},
    }
    task = {"horizon": 1_000_000, "observations": {"policy": ["last_action"]}}
    with anysim.make({"engine": engine, "num_envs": envs, "world": world, "task": task}) as env:
        env.reset(seed=0)
        still = np.zeros((envs, 0))

        def steps() -> None:
            for _ in range(STEPS):
                env.step(still)

        return best_of(rounds, steps) / STEPS

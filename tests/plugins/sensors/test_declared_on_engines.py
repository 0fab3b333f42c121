"""Sensors that look, on engines: equal readings at equal poses, MuJoCo's own rays, recordings that replay."""

from collections.abc import Mapping
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.conventions import Array
from anysim.errors import SpecError
from anysim.math import pose as P
from anysim.record.reader import open_trajectory
from anysim.record.replay import replay
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_recording.collector import Collector
from tests.plugins.sensors.declared import SENSORS, world
from tests.schemas.test_every_key import Still

EXACT = {
    name: {key: value for key, value in one.items() if key not in ("noise", "delay", "dropout", "rate")}
    for name, one in SENSORS.items()
}
EXACT["eye"] |= {"position": [0.3, 0.0, 0.8], "roll_pitch_yaw": [-pi / 2 - 0.8, 0.0, -pi / 2], "fov": 40.0}
"""It looks down: poses differ by 4e-10 once an engine has made a quaternion a unit one, and a ray that grazes a hill by
half a milliradian makes 2e-6 m of that."""
HILLS = {"kind": "waves", "amplitude": 0.08, "wavelength": 1.5, "seed": 2, "size": [8, 8], "platform": 0.5}


def seen(env: TaskEnv, poses: Array) -> dict[str, Array]:
    """What is read with all bodies at these poses (N, B, 7)."""
    everyone = np.arange(env.num_envs)
    env.engine.set_body_state(pose=poses, twist=np.zeros((*poses.shape[:2], 6)))
    env.scene.look(None)
    assert env.sensors is not None
    env.sensors.reset(everyone)
    env.sensors.begin(everyone)
    return env.sensors.recorded(everyone)


def test_one_file_gives_equal_readings_on_three_engines() -> None:
    """Heights of hills, ranges, images and cells; with poses such as SAPIEN can have, in single precision."""
    rng = np.random.default_rng(3)
    spec = world(sensors=EXACT, terrain=HILLS)
    readings: dict[str, dict[str, Array]] = {}
    poses = np.zeros(0)
    for engine in ("sapien", "mujoco", "pybullet"):
        require_engine(engine)
        with anysim.make({**spec, "engine": engine}, num_envs=2) as env:
            env.reset(seed=0)
            if engine == "sapien":
                poses = env.engine.get_state().body_pose.copy()
                poses[..., 2] += rng.uniform(0.05, 0.3, poses.shape[:2])
                turn = P.from_roll_pitch_yaw(rng.uniform(-0.05, 0.05, (*poses.shape[:2], 3)))
                poses[..., 3:] = P.multiply(poses[..., 3:], turn)
            readings[engine] = seen(env, poses)
            if engine == "sapien":
                poses = env.engine.get_state().body_pose.copy()
    first = readings["sapien"]
    assert np.ptp(first["sensor_ground_height"]) > 0.1
    assert len(np.unique(first["sensor_ring_instance_id"])) == 3
    assert np.ptp(first["sensor_eye_depth"]) > 0.5
    for engine in ("mujoco", "pybullet"):
        for name, rows in readings[engine].items():
            gap = np.abs(rows.astype(float) - first[name]).max()
            assert gap < 1e-6, (engine, name, gap)


def test_none_of_five_thousand_rays_is_a_millimetre_off_mujocos() -> None:
    """A LiDAR and a depth camera by two sources, on nothing that collides, over a crowd of shapes."""
    require_engine("mujoco")
    rng = np.random.default_rng(7)
    sources = [{"box": [0.3, 0.5, 0.4]}, {"sphere": 0.3}, {"capsule": [0.15, 0.5]}, {"cylinder": [0.2, 0.6]}]
    names = [f"thing{i}" for i in range(20)]
    objects = {name: {"source": sources[i % 4], "fixed": True} for i, name in enumerate(names)}
    places = np.column_stack([rng.uniform(-3, 3, (20, 2)), rng.uniform(0.5, 2.0, 20)])
    layout = {
        n: {"position": at, "yaw": float(i)} for i, (n, at) in enumerate(zip(names, places.tolist(), strict=True))
    }
    both = {
        "sensor": "lidar",
        "frame": "thing0",
        "position": [0.0, 0.0, 1.2],
        "far": 6.0,  # MuJoCo's plane ends 10 m from the origin
        "pattern": {"kind": "spinning", "elevations": np.linspace(-1.0, 0.6, 20).tolist(), "columns": 250},
        "channels": ["range", "instance_id", "class_id"],
        "leave_out": "nothing",
    }
    eye = {
        **{key: both[key] for key in ("frame", "position", "leave_out")},
        "far": 3.0,  # along the axis: 8 m in a corner
        "sensor": "depth",
        "roll_pitch_yaw": [-pi / 2 - 0.4, 0.0, -pi / 2],
        "size": [100, 50],
        "fov": 100.0,
        "channels": ["depth", "instance_id", "class_id"],
    }
    spec = {
        "engine": "mujoco",
        "world": {
            "objects": objects,
            "layout": layout,
            "sensors": {
                f"{name}_{source}": sensor | {"source": source}
                for name, sensor in (("scan", both), ("eye", eye))
                for source in ("geometry", "engine")
            },
        },
        "task": {"observations": {"policy": ["last_action"]}},
    }
    with anysim.make(spec) as env:
        env.reset(seed=0)
        assert env.sensors is not None
        for name, far, most in (("scan", "range", 6.0), ("eye", "depth", 3.0)):
            one, two = (
                {
                    key: env.sensors.reading(f"{name}_{source}", key)[0].ravel()
                    for key in (far, "instance_id", "class_id")
                }
                for source in ("geometry", "engine")
            )
            assert one[far].shape == (5000,)
            assert 500 < (one[far] < most).sum() < 4900
            assert len(np.unique(one["instance_id"])) > (10 if name == "scan" else 3)
            assert (np.abs(one[far] - two[far]) > 1e-3).sum() == 0
            assert (one["instance_id"] == two["instance_id"]).mean() > 0.999
            assert (one["class_id"] == two["class_id"]).mean() > 0.999


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"channels": ["range", "intensity"], "leave_out": "nothing"}, "distances and things, so no 'intensity'"),
        ({}, "say so with `leave_out: nothing`"),
        ({"leave_out": "nothing", "shapes": "visual"}, "meet what collides"),
    ],
)
def test_what_rays_of_engines_cannot_do_is_refused(more: dict[str, Any], words: str) -> None:
    require_engine("mujoco")
    sensor = {"sensor": "lidar", "frame": "rover", "preset": "utm_30lx", "source": "engine", **more}
    with pytest.raises(SpecError, match=words):
        anysim.make(world("mujoco", {"it": sensor}))


def falling(sensors: dict[str, Any]) -> dict[str, Any]:
    """The rover begins in the air and turned."""
    spec = world("mujoco", sensors)
    rover = {"position": [0.0, 0.0, 0.6], "yaw": pi / 7}
    spec["world"] = {**spec["world"], "layout": {**spec["world"]["layout"], "rover": rover}}
    return {**spec, "task": {**spec["task"], "horizon": 12}, "record": {"keep": "all"}}


def recorded(spec: dict[str, Any], out: Path) -> Mapping[str, Array]:
    with anysim.make(spec, num_envs=2) as env:
        list(Collector(env, Still(env), out, 2, seed=1).run())
    return open_trajectory(sorted((out / "episodes").iterdir())[0]).states


def test_recordings_replay_to_the_bit_and_one_more_sensor_moves_nothing(tmp_path: Path) -> None:
    require_engine("mujoco")
    every = recorded(falling(SENSORS), tmp_path / "every")
    assert len(np.unique(every["sensor_ground_height"], axis=0)) == len(every["sensor_ground_height"])
    assert every["sensor_eye_motion"].any()
    for path in sorted((tmp_path / "every" / "episodes").iterdir()):
        assert replay(path).identical
    ring = recorded(falling({"ring": SENSORS["ring"]}), tmp_path / "ring")
    assert {name for name in ring if name.startswith("sensor_")} < set(every)
    for name, rows in ring.items():
        assert rows.tobytes() == every[name].tobytes(), name


def test_a_snapshot_in_the_air_goes_on_with_the_same_bits() -> None:
    require_engine("mujoco")
    with anysim.make(falling(SENSORS), num_envs=2) as env:

        def go(steps: int) -> list[dict[str, bytes]]:
            found = []
            for _ in range(steps):
                env.step(np.zeros((2, 0)))
                found.append({name: rows.tobytes() for name, rows in env.sensor_rows(np.arange(2)).items()})
            return found

        env.reset(seed=3)
        go(3)
        snapshot = env.snapshot()
        expected = go(6)
        env.reset(seed=9)
        env.reset_to(snapshot)
        assert go(6) == expected


def test_a_legged_robot_observes_the_ground_around_it() -> None:
    """A height scan over waves, and a LiDAR on the trunk, as the observation of a policy that commands the legs."""
    require_engine("mujoco")
    spec = {
        "engine": "mujoco",
        "world": {
            "terrain": {"kind": "waves", "amplitude": 0.1, "size": [6, 6], "platform": 0.8, "seed": 1},
            "robots": {"go2": {"robot": "unitree_go2", "position": [0.0, 0.0, 0.05]}},
            "sensors": {
                "ground": {"sensor": "heights", "frame": "go2"},
                "scan": {
                    "sensor": "lidar",
                    "frame": "go2",
                    "pattern": {"kind": "spinning", "elevations": [-0.5, -0.3], "columns": 30},
                    "far": 5.0,
                    "leave_out": "entity",
                    "rate": 10,
                },
            },
        },
        "task": {"observations": {"policy": [{"term": "sensor", "of": n} for n in ("ground.height", "scan.range")]}},
    }
    with anysim.make(spec, num_envs=2) as env:
        env.reset(seed=0)
        for _ in range(5):
            env.step(np.zeros((2, env.action_dim)))
        seen, trunk = env.obs["policy"], env.engine.get_state().body_pose[:, env.engine.index.frame("go2").body]
        ground = env.engine.world.ground
    assert seen.shape == (2, 187 + 60)
    assert np.ptp(seen[:, :187]) > 0.05
    under = ground.heights_at(trunk[:, None, :2])[:, 0] - trunk[:, 2]
    assert seen[:, 93] == pytest.approx(under, abs=1e-5)  # the middle of 11 x 17 points
    assert 0.3 < seen[:, 187:].min() < 2.0

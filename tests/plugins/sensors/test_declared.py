"""Sensors that look, as worlds declare them: what they read, what they refuse, and what robots bring."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.conventions import Array
from anysim.errors import SpecError
from anysim.testing.sensors import check_sensor
from tests.plugins.sensors.declared import SENSORS, world


@pytest.mark.parametrize("name", list(SENSORS))
def test_they_keep_their_promises(name: str) -> None:
    check_sensor(world(), name)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
@pytest.mark.parametrize("name", list(SENSORS))
def test_they_keep_them_where_things_move(name: str, engine: str) -> None:
    check_sensor(world(), name, engine=engine)


def read(sensor: dict[str, Any], **more: Any) -> dict[str, Array]:
    """All fields of a sensor of env 0 at the reset."""
    with anysim.make(world(sensors={"it": sensor}, **more)) as env:
        env.reset(seed=0)
        assert env.sensors is not None
        return {key: env.sensors.reading("it", key)[0] for key in env.sensors.fields("it")}


def test_a_lidar_reads_ranges_ids_and_brightness() -> None:
    """Ahead the red crate, 1.8 m away and faced squarely; to the left the ball, on whose side it looks askance."""
    seen = read({k: v for k, v in SENSORS["ring"].items() if k not in ("noise", "dropout")})
    ahead = 45  # azimuths begin at -pi
    assert seen["range"].dtype == np.float32
    assert seen["range"][ahead] == pytest.approx(1.8, abs=1e-6)
    assert seen["intensity"][ahead] == pytest.approx(0.2126, abs=1e-6)
    assert seen["range"][0] == 8.0
    assert (seen["instance_id"][0], seen["class_id"][0], seen["intensity"][0]) == (0, 0, 0.0)
    assert set(seen["instance_id"].tolist()) == {0, 1, 2}
    assert seen["class_id"][ahead] == 1  # crate, fruit, rover
    assert set(seen["class_id"][seen["instance_id"] == 2].tolist()) == {2}
    assert 0 < seen["intensity"][seen["instance_id"] == 2].max() <= 0.7152


def test_what_carries_it_is_left_out_or_seen() -> None:
    inside = {"sensor": "lidar", "frame": "rover", "pattern": {"kind": "planar", "columns": 4}, "far": 8.0}
    assert read(inside)["range"] == pytest.approx([8.0, 8.0, 1.8, 8.0], abs=1e-6)
    assert read(inside | {"leave_out": "nothing"})["range"] == pytest.approx([0.25, 0.15, 0.25, 0.15], abs=1e-6)


def test_a_pattern_that_never_repeats_goes_on() -> None:
    petals = {k: v for k, v in SENSORS["petals"].items() if k not in ("rate", "delay")}
    with anysim.make(world(sensors={"petals": petals})) as env:
        assert env.sensors is not None
        scans = []
        for _ in range(2):
            env.reset(seed=0)
            for _ in range(3):
                scans.append(env.sensors.reading("petals", "range")[0])
                env.step(np.zeros((1, 0)))
    assert not np.array_equal(scans[0], scans[1])
    assert all(np.array_equal(one, two) for one, two in zip(scans[:3], scans[3:], strict=True))


def test_heights_are_those_over_the_frame() -> None:
    ground = read({"sensor": "heights", "frame": "rover"})["height"]
    assert (ground.shape, ground.dtype) == ((11, 17), np.float32)
    assert ground == pytest.approx(np.full((11, 17), -0.1), abs=1e-6)
    scan = {"sensor": "heights", "frame": "rover", "source": "rays", "length": 4.6, "spacing": 0.2}
    assert read(scan)["height"][2] == pytest.approx([-0.1] * 21 + [0.3] * 2 + [-0.1], abs=1e-6)  # the crate, 2 m ahead
    low = read({**scan, "limit": 0.05})["height"][2]
    assert low == pytest.approx([-0.05] * 21 + [0.05] * 2 + [-0.05], abs=1e-6)


def test_a_depth_camera_gives_the_channels_that_are_asked_for() -> None:
    seen = read(SENSORS["eye"])
    shapes = {key: (rows.shape, str(rows.dtype)) for key, rows in seen.items() if key not in ("time", "valid")}
    assert shapes == {
        "depth": ((16, 24), "float32"),
        "normals": ((16, 24, 3), "float32"),
        "instance_id": ((16, 24), "int32"),
        "class_id": ((16, 24), "int32"),
        "motion": ((16, 24, 2), "float32"),
        "appeared": ((16, 24), "uint8"),
    }
    crate = seen["instance_id"] == 1
    assert crate.sum() > 4
    assert seen["depth"][crate & (seen["normals"][..., 0] < -0.99)] == pytest.approx(1.5, abs=1e-6)
    sky = seen["depth"] == 6.0
    assert sky.any()
    assert not seen["normals"][sky].any()
    assert np.abs(seen["motion"]).max() < 1e-9
    assert not seen["appeared"].any()
    assert list(read({"sensor": "depth", "frame": "rover", "size": [4, 4]})) == ["depth", "time", "valid"]


def test_motion_is_how_far_what_is_seen_came_and_tells_what_appears() -> None:
    """The crate steps aside by 0.3 m, at 1.5 m: by 0.3/1.5 focal lengths to the right, and uncovers the ground."""
    with anysim.make(world(sensors={"eye": SENSORS["eye"] | {"size": [48, 32]}})) as env:
        env.reset(seed=0)
        assert env.sensors is not None
        index = env.engine.index.body("crate")
        pose = env.engine.get_state().body_pose[:, [index]].copy()
        pose[..., 1] -= 0.3
        env.engine.set_body_state(pose=pose, bodies=[index])
        env.step(np.zeros((1, 0)))
        seen = {key: env.sensors.reading("eye", key)[0] for key in env.sensors.fields("eye")}
    front = (seen["instance_id"] == 1) & (seen["normals"][..., 0] < -0.99)
    focal = 32 / (2 * np.tan(np.radians(30)))
    assert front.sum() > 10
    assert seen["motion"][front][:, 0] == pytest.approx(0.3 / 1.5 * focal, abs=1e-4)
    assert seen["motion"][front][:, 1] == pytest.approx(0.0, abs=1e-4)
    appeared = seen["appeared"].astype(bool)
    assert not appeared[front].any()
    assert appeared.any()
    assert np.nonzero(appeared)[1].max() < 24 + 0.2 / 1.5 * focal  # where the crate was, ahead


def test_occupancy_has_three_values() -> None:
    cells = read({"sensor": "occupancy", "frame": "rover", "low": 0.05, "high": 0.5, "cell": 0.2})["cells"]
    assert (cells.shape, cells.dtype) == ((30, 30), np.int8)
    assert set(cells.ravel().tolist()) == {-1, 0, 1}
    assert cells[15, 15] == 0
    assert cells[15, 24] == 1  # the crate's front
    assert cells[15, 27] == -1  # behind it


@pytest.mark.parametrize(
    ("sensor", "words"),
    [
        ({"sensor": "lidar"}, "either a `preset` or a `pattern`"),
        ({"sensor": "lidar", "preset": "vlp_61"}, "did you mean 'vlp_16'"),
        ({"sensor": "lidar", "preset": "vlp_16", "near": 200.0}, r"`near` \(200 m\) is less than `far` \(100 m\)"),
        ({"sensor": "lidar", "preset": "vlp_16", "channels": ["rnage"]}, "did you mean 'range'"),
        ({"sensor": "lidar", "preset": "utm_30lx", "source": "engine"}, "null does not have 'raycast'"),
        ({"sensor": "depth", "preset": "d435", "fov": 0.5}, "greater than 1"),
        ({"sensor": "depth", "preset": "kinect"}, "presets: d435, kinect_v2"),
        ({"sensor": "heights", "length": 100.0, "spacing": 0.001}, "choose a larger `spacing`"),
        ({"sensor": "occupancy", "low": 1.0, "high": 0.0}, r"`low` \(1 m\) is below `high` \(0 m\)"),
        ({"sensor": "occupancy", "noise": {"cells": {"white": 1.0}}}, "whole numbers, which no noise is added to"),
    ],
)
def test_what_is_wrong_is_said_at_its_key(sensor: dict[str, Any], words: str) -> None:
    with pytest.raises(SpecError, match=words) as found:
        read({"frame": "rover", **sensor})
    assert "world.sensors.it" in str(found.value)


ROBOT = """
name: scanner
description: a cart with a LiDAR
source: cart.urdf
license: Apache-2.0
license_source: this file
category: base
base: fixed
channels:
  base: {joints: [slide], gains: {kp: 100, kd: 20}, controllers: {joint_position: {}}}
sensors:
  top:
    kind: lidar
    link: cart
    position: [0.0, 0.0, 0.3]
    params: {pattern: {kind: planar, columns: 8}, far: 5.0}
    noise: {range: {bias: 0.5}}
"""
CART = """<robot name="cart"><link name="rail"/><link name="cart">
  <inertial><mass value="5"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.4 0.3 0.2"/></geometry></collision>
</link>
<joint name="slide" type="prismatic"><parent link="rail"/><child link="cart"/><axis xyz="1 0 0"/>
  <limit lower="-1" upper="1" effort="100" velocity="1"/></joint>
</robot>"""


def test_a_robot_brings_its_lidar(tmp_path: Path) -> None:
    """With its pattern, its range and its noise; a world may say otherwise."""
    (tmp_path / "cart.urdf").write_text(CART)
    (tmp_path / "scanner.yaml").write_text(ROBOT)
    spec = {
        "engine": "null",
        "world": {
            "robots": {"cart": {"robot": str(tmp_path / "scanner.yaml")}},
            "objects": {"crate": {"source": {"box": [0.4, 0.4, 1.4]}, "fixed": True}},
            "layout": {"crate": {"position": [2.0, 0.0, 0.7]}},
            "sensors": {"top": "cart.top", "own": {"place": "cart.top", "far": 3.0, "noise": {"range": {}}}},
        },
        "task": {"observations": {"policy": [{"term": "sensor", "of": "top"}]}},
    }
    with anysim.make(spec) as env:
        env.reset(seed=0)
        assert env.obs["policy"][0] == pytest.approx([5.5] * 4 + [2.3] + [5.5] * 3, abs=1e-6)
        assert env.sensors is not None
        assert env.sensors.reading("own", "range")[0] == pytest.approx([3.0] * 4 + [1.8] + [3.0] * 3, abs=1e-6)

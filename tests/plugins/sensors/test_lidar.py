"""LiDARs: patterns with the angles of their data sheets, and scans of a room that is known."""

from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.model.frames import FixedFrame
from anysim.model.world import Box, Sphere
from anysim.testing.sketch import Sketch
from anysim_sensors.lidar import lidar
from anysim_sensors.patterns import planar, rosette, spinning, wound
from anysim_sensors.presets import CAMERAS, LIDARS, lidar_preset
from anysim_sensors.scene import SceneGeometry, mounted


def angles(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.arctan2(directions[:, 1], directions[:, 0]), np.arcsin(directions[:, 2])


@pytest.mark.parametrize("name", LIDARS)
def test_presets_have_unit_directions_in_order_of_time(name: str) -> None:
    preset = lidar_preset(name)
    pattern = preset.pattern(0)
    assert np.abs(np.linalg.norm(pattern.directions, axis=1) - 1).max() < 1e-12
    assert pattern.times[0] == 0.0
    assert (np.diff(pattern.times) >= 0).all()
    assert pattern.times[-1] < 1 / preset.rate
    assert 0 < preset.near < preset.far
    assert len(pattern.directions) == {"vlp_16": 28_800, "mid_360": 20_000, "mid_40": 10_000, "utm_30lx": 1081}[name]


def test_a_spinning_lidar_has_its_beams_at_each_azimuth() -> None:
    azimuth, elevation = angles(spinning(np.radians([-10.0, 0.0, 10.0]), 4, 10.0).directions)
    assert np.degrees(elevation) == pytest.approx([-10, 0, 10] * 4)
    assert np.degrees(azimuth) % 360 == pytest.approx(np.repeat([180, 270, 0, 90], 3), abs=1e-9)
    azimuth, _ = angles(planar(1081, 40.0, np.radians(270)).directions)
    assert np.degrees(np.diff(azimuth)) == pytest.approx(0.25)
    assert np.degrees(azimuth[[0, -1]]) == pytest.approx([-135, 135])


def test_solid_state_patterns_stay_in_their_field_and_fill_it_scan_after_scan() -> None:
    half = np.radians(19.2)
    first, second = (rosette(10_000, 10.0, half, scan=k).directions for k in (0, 1))
    off_axis = np.arccos(first[:, 0])
    assert off_axis.max() == pytest.approx(half, rel=0.01)
    assert np.linalg.norm(first[0] - second[0]) > 1e-3
    azimuth, elevation = angles(wound(20_000, 10.0, np.radians(-7), np.radians(52)).directions)
    assert np.degrees([elevation.min(), elevation.max()]) == pytest.approx([-7, 52], abs=0.2)
    assert np.histogram(azimuth, 36, (-np.pi, np.pi))[0].min() > 300

    def filled(scans: int) -> int:
        cells = [np.floor(np.degrees(angles(rosette(10_000, 10.0, half, scan=k).directions))) for k in range(scans)]
        return len(np.unique(np.concatenate(cells, axis=1), axis=1).T)

    assert filled(10) > 1.2 * filled(1)


def test_a_scan_of_a_room_has_its_distances() -> None:
    """A sensor on a turned robot in a closed room; its own body, which is around it, is left out."""
    s = Sketch("room")
    for k, (x, y) in enumerate([(1, 0), (-1, 0), (0, 1), (0, -1)]):
        s.fixed(f"wall{k}", Box((0.1 if x else 5.0, 0.1 if y else 5.0, 5.0)), (3.1 * x, 2.1 * y, 0.0))
    yaw = P.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(0.7))
    robot = s.free("robot", Sphere(0.4), (0.5, -0.25, 0.0), quaternion=tuple(yaw))
    scene = SceneGeometry(s.world())
    posed = scene.posed(scene.world.initial_body_pose[None])
    frames = mounted(scene.world.initial_body_pose[None], FixedFrame(robot, (0.0, 0.0, 0.1), (0.0, 0.0, 0.0, 1.0)))
    pattern = planar(720, 10.0)
    scan = lidar(scene, posed, frames, pattern.directions, near=0.1, far=4.0, seen=scene.without([robot]))
    at = P.rotate(frames[0, 3:], scan.points[0]) + frames[0, :3]
    met = np.isfinite(scan.distance[0])
    flat = P.rotate(frames[0, 3:], pattern.directions)
    answer = np.minimum(
        np.where(flat[:, 0] > 0, 2.5, 3.5) / np.abs(flat[:, 0]),
        np.where(flat[:, 1] > 0, 2.25, 1.75) / np.abs(flat[:, 1]),
    )
    assert (met == (answer <= 4.0)).all()
    assert 0.5 < met.mean() < 1
    assert np.abs(scan.distance[0][met] - answer[met]).max() < 1e-12
    on_wall = np.minimum(np.abs(np.abs(at[met, 0]) - 3.0), np.abs(np.abs(at[met, 1]) - 2.0))
    assert on_wall.max() < 1e-12
    assert np.isnan(scan.points[0][~met]).all()
    assert set(scan.segmentation[0][met]) == {1, 2, 3, 4}
    assert (scan.segmentation[0][~met] == 0).all()
    with_own = lidar(scene, posed, frames, pattern.directions, near=0.1, far=4.0)
    assert (with_own.segmentation == 5).all()
    blind = lidar(scene, posed, frames, pattern.directions, near=0.6, far=4.0)
    assert np.isinf(blind.distance).all()


def test_an_unknown_preset_names_those_that_exist() -> None:
    with pytest.raises(AnysimError, match=r"no preset of a LiDAR 'vlp16'; did you mean 'vlp_16'.*mid_360"):
        lidar_preset("vlp16")


def test_the_table_of_presets_says_what_they_are() -> None:
    page = (Path(__file__).parents[3] / "docs" / "concepts" / "sensing.md").read_text()
    rays = {name: len(one.pattern(0).directions) for name, one in LIDARS.items()}
    rays |= {name: one.width * one.height for name, one in CAMERAS.items()}
    for name, one in {**LIDARS, **CAMERAS}.items():
        cells = next(line for line in page.splitlines() if line.startswith(f"| `{name}` |")).split(" | ")
        assert cells[2:] == [f"{rays[name]:,}", f"{one.near:g} to {one.far:g}", f"{one.rate:g} |"]


@pytest.mark.parametrize("robot", ["differential_base", "holonomic_base"])
def test_bases_of_the_catalogue_bring_a_scanner_and_a_depth_camera(robot: str) -> None:
    """A wall stands two metres ahead; the scanner is 1 cm off at a time, and neither sees the base."""
    spec = {
        "engine": "null",
        "world": {
            "robots": {"rover": {"robot": robot, "actions": {}}},
            "objects": {"wall": {"source": {"box": [0.2, 8.0, 2.0]}, "fixed": True}},
            "layout": {"wall": {"position": [2.1, 0.0, 1.0]}},
            "sensors": {"scan": "rover.scan", "eye": {"place": "rover.eye", "size": [33, 25]}},
        },
        "task": {"observations": {"policy": [{"term": "sensor", "of": "scan.range"}]}},
    }
    with anysim.make(spec) as env:
        env.reset(seed=0)
        assert env.sensors is not None
        ranges, depth = env.sensors.reading("scan", "range")[0], env.sensors.reading("eye", "depth")[0]
        place = {site.name: site.position[0] for site in env.engine.world.sites}
    assert ranges.shape == (1081,)
    assert depth[12, 16] == pytest.approx(2.0 - place["rover.eye"], abs=1e-5)
    azimuth = np.radians(np.linspace(-135, 135, 1081))
    front = np.abs(azimuth) < 0.8
    error = ranges[front] - (2.0 - place["rover.scan"]) / np.cos(azimuth[front])
    assert 0.007 < error.std() < 0.013
    assert abs(error.mean()) < 0.003

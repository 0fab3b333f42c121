"""Occupancy grids: what is in sight is known as it is, and what is behind something is not."""

import numpy as np

from anysim.math import pose as P
from anysim.model.world import Box, Cylinder
from anysim.testing.sketch import Sketch
from anysim_sensors.lidar import lidar
from anysim_sensors.occupancy import Grid, occupancy, occupancy_of_scan
from anysim_sensors.patterns import planar
from anysim_sensors.scene import SceneGeometry
from anysim_sensors.states import FREE, OCCUPIED, UNKNOWN
from tests.plugins.sensors import worlds

GRID = Grid((6.0, 6.0), 0.05)
LOW = np.array([[0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0]])
FLOOR = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])


def centres(grid: Grid = GRID) -> tuple[np.ndarray, np.ndarray]:
    rows, columns = grid.shape
    x, y = (np.arange(columns) + 0.5 - columns / 2) * grid.cell, (np.arange(rows) + 0.5 - rows / 2) * grid.cell
    u, v = np.meshgrid(x, y)
    return u, v


def scene_of(*boxes):
    s = Sketch("room")
    s.ground()
    for k, (half, position, quaternion) in enumerate(boxes):
        s.fixed(f"box{k}", Box(half), position, quaternion=quaternion)
    return SceneGeometry(s.world())


STRAIGHT = (0.0, 0.0, 0.0, 1.0)


def test_a_box_is_occupied_where_it_is_seen_and_hides_what_is_behind() -> None:
    scene = scene_of(((0.2, 0.5, 0.5), (1.2, 0.0, 0.5), STRAIGHT))
    states = occupancy(scene, scene.posed(scene.world.initial_body_pose[None]), FLOOR, GRID)[0]
    assert states.shape == (120, 120)
    x, y = centres()
    assert set(np.unique(states)) == {UNKNOWN, FREE, OCCUPIED}
    front = (np.abs(x - 1.0) < 0.05) & (np.abs(y) < 0.45)
    assert (states[front & (x > 1.0)] == OCCUPIED).all()
    shadow = (x > 1.45) & (np.abs(y) < 0.45 * x)
    assert (states[shadow] == UNKNOWN).all()
    assert (states[(x < 0.9) | (np.abs(y) > 0.62 * x)] == FREE).all()
    occupied = states == OCCUPIED
    inside = np.maximum(np.abs(x - 1.2) - 0.2, np.abs(y) - 0.5)
    assert inside[occupied].max() <= GRID.cell / 2 + 1e-9


def test_only_what_is_between_the_heights_is_in_the_way() -> None:
    plate = ((0.3, 0.3, 0.02), (1.0, 0.0, 0.02), STRAIGHT)
    lamp = ((0.3, 0.3, 0.1), (-1.0, 0.0, 1.6), STRAIGHT)
    table = ((0.3, 0.3, 0.02), (0.0, 1.0, 0.7), STRAIGHT)
    scene = scene_of(plate, lamp, table)
    posed = scene.posed(scene.world.initial_body_pose[None])
    states = occupancy(scene, posed, FLOOR, GRID)[0]
    _, y = centres()
    assert (states[y < 0.6] == FREE).all()
    assert (states == OCCUPIED).sum() >= 12
    lower = occupancy(scene, posed, FLOOR, GRID._replace(high=0.6))[0]
    assert (lower == FREE).all()
    scan = lidar(scene, posed, LOW, planar(720, 10.0).directions, far=5.0)
    blind = occupancy_of_scan(scan.distance, np.linspace(-np.pi, np.pi, 720, endpoint=False), GRID, 5.0)[0]
    assert not (blind == OCCUPIED).any()  # a LiDAR at 0.3 m passes below the table


def test_no_cell_with_something_in_it_is_free() -> None:
    """Against points taken densely inside of random shapes: a cell that is called free holds none of them."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        world = worlds.crowd(rng, 25)
        scene = SceneGeometry(world)
        posed = scene.posed(world.initial_body_pose[None])
        start = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, np.sin(0.3), np.cos(0.3)]])
        states = occupancy(scene, posed, start, GRID)[0]
        x, y = centres()
        heights = np.arange(0.1, 1.2, 0.0125)
        columns = np.stack([np.broadcast_to(v[..., None], (*x.shape, len(heights))) for v in (x, y)], axis=-1)
        points = np.concatenate([columns, np.broadcast_to(heights[:, None], (*columns.shape[:-1], 1))], axis=-1)
        near = scene.distances(posed, start, points.reshape(-1, 3), reach=0.1).distance.reshape(*x.shape, -1)
        within = (near <= GRID.cell / 2 + 0.0125 / 2).any(axis=-1)
        assert ((states == OCCUPIED) <= within).all()
        deep = (near <= GRID.cell / 2 - 0.004).any(axis=-1)
        assert not (deep & (states == FREE)).any()
        assert (states == OCCUPIED).sum() > 50


def test_the_grid_turns_with_the_heading_and_not_with_the_tilt() -> None:
    scene = scene_of(((0.2, 0.2, 0.5), (0.0, 1.5, 0.5), STRAIGHT))
    posed = scene.posed(scene.world.initial_body_pose[None])
    turned = P.from_roll_pitch_yaw(np.array([0.1, 0.2, np.pi / 2]))
    straight = occupancy(scene, posed, FLOOR, GRID)[0]
    rotated = occupancy(scene, posed, np.concatenate([FLOOR[:, :3], turned[None]], axis=1), GRID)[0]
    heading = np.arctan2(*P.rotate(turned, np.array([1.0, 0.0, 0.0]))[1::-1])
    assert abs(heading - np.pi / 2) < 1e-9
    assert (rotated == np.rot90(straight)).mean() > 0.999


def test_the_ranges_of_a_lidar_make_the_same_map_of_walls() -> None:
    s = Sketch("pillars")
    for k in range(5):
        s.fixed(f"pillar{k}", Cylinder(0.2, 1.0), (1.7 * np.cos(1.3 * k), 1.7 * np.sin(1.3 * k), 0.5))
    scene = SceneGeometry(s.world())
    posed = scene.posed(scene.world.initial_body_pose[None])
    azimuth = np.linspace(-np.pi, np.pi, 1440, endpoint=False)
    scan = lidar(scene, posed, LOW, planar(1440, 10.0).directions, far=5.0)
    map_of_scan = occupancy_of_scan(scan.distance, azimuth, GRID, 5.0)[0]
    there = occupancy(scene, posed, FLOOR, GRID)[0]
    assert (map_of_scan == OCCUPIED).sum() > 50
    x, y = centres()
    away = np.min([np.hypot(x - 1.7 * np.cos(1.3 * k), y - 1.7 * np.sin(1.3 * k)) for k in range(5)], axis=0) - 0.2
    assert np.abs(away[map_of_scan == OCCUPIED]).max() < GRID.cell
    turn = 1.3 * np.arange(5)[:, None, None]
    ahead, aside = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    shadow = ((ahead > 1.8) & (np.abs(aside) * 1.7 / np.maximum(ahead, 1e-9) < 0.2 - GRID.cell)).any(axis=0)
    assert shadow.sum() > 1000
    for states in (map_of_scan, there):
        assert (states[shadow & (away > GRID.cell)] == UNKNOWN).all()
        assert (states[np.hypot(x, y) < 1.4] == FREE).all()


def test_reach_ends_what_is_known() -> None:
    scene = scene_of()
    posed = scene.posed(scene.world.initial_body_pose[None])
    states = occupancy(scene, posed, FLOOR, GRID, reach=1.0)[0]
    x, y = centres()
    assert (states[np.hypot(x, y) < 0.93] == FREE).all()
    assert (states[np.hypot(x, y) > 1.08] == UNKNOWN).all()

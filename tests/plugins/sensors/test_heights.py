"""Height scans: the table as the ground's own heights, and rays where there is no table."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.conventions import WORLD
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.model.world import Box, Geom, HeightField, HeightFieldShape, Plane, World
from anysim.testing import ground
from anysim.testing.sketch import Sketch
from anysim_sensors.heights import GroundHeights, scanned_heights, upright
from anysim_sensors.patterns import grid
from anysim_sensors.scene import SceneGeometry


def frames_over(rng: np.random.Generator, count: int) -> np.ndarray:
    """Places over the hills with any heading and some roll and pitch."""
    tilt = P.from_roll_pitch_yaw(rng.uniform([-0.3, -0.3, -3], [0.3, 0.3, 3], (count, 3)))
    return np.column_stack([rng.uniform([-1.8, -1.3, 0.8], [1.8, 1.3, 1.2], (count, 3)), tilt])


def test_the_table_has_the_heights_of_the_ground_and_rays_see_the_same() -> None:
    world = ground.hills(as_mesh=False)
    rng = np.random.default_rng(1)
    frames, points = frames_over(rng, 8), grid((1.6, 1.0), 0.1)
    assert points.shape == (17 * 11, 2)
    assert points.min(axis=0) == pytest.approx([-0.8, -0.5])
    heights = GroundHeights(world).at(frames, points)
    yaw = np.arctan2(*P.rotate(frames[:, 3:], np.tile([1.0, 0.0, 0.0], (8, 1)))[:, 1::-1].T)
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y = points.T
    places = frames[:, None, :2] + np.stack([c * x - s * y, s * x + c * y], axis=-1)
    answer = world.ground.heights_at(places)
    assert (np.isnan(answer) == np.isnan(heights)).all()
    assert 0.05 < np.isnan(answer).mean() < 0.6
    on = ~np.isnan(answer)
    assert np.abs(heights[on] - answer[on]).max() < 1e-12
    scene = SceneGeometry(world)
    seen = scanned_heights(scene, scene.posed(np.zeros((8, 0, 7))), frames, points)
    assert (np.isnan(seen) == np.isnan(heights)).mean() > 0.999  # at the border itself a ray may miss
    both = on & ~np.isnan(seen)
    assert np.abs(seen[both] - heights[both]).max() < 1e-9


def test_the_edge_between_the_triangles_of_a_cell_goes_up_from_its_lowest_corner() -> None:
    heights = np.array([[0.0, 1.0], [1.0, 0.0]])  # along that edge it stays at 0, along the other at 1
    world = World(
        geoms=(Geom("terrain", WORLD, HeightFieldShape("cell"), position=(0.5, 0.5, 0.0)),),
        heightfields=(HeightField("cell", heights, (1.0, 1.0)),),
    )
    at = np.array([[0.5, 0.5], [0.25, 0.25], [0.75, 0.25], [0.25, 0.75]])
    frame = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    assert GroundHeights(world).at(frame, at)[0] == pytest.approx([0.0, 0.0, 0.5, 0.5], abs=1e-12)


def test_the_highest_ground_counts_and_beside_a_field_there_is_a_plane() -> None:
    fields = (HeightField("low", np.full((3, 3), -1.0), (2.0, 2.0)), HeightField("high", np.ones((3, 3)), (2.0, 2.0)))
    geoms = (
        Geom("a", WORLD, HeightFieldShape("low")),
        Geom("b", WORLD, HeightFieldShape("high"), position=(1.5, 0.0, 0.25)),
        Geom("c", WORLD, Plane(), position=(0.0, 0.0, -0.5)),
    )
    world = World(geoms=geoms, heightfields=fields)
    frame = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    at = np.array([[0.0, 0.0], [1.5, 0.0], [0.9, 0.9], [-1.5, 0.0]])
    assert GroundHeights(world).at(frame, at)[0] == pytest.approx([-0.5, 1.25, 1.25, -0.5])
    alone = replace(world, geoms=geoms[:2])
    found = GroundHeights(alone).at(frame, at)[0]
    assert found[:3] == pytest.approx([-1.0, 1.25, 1.25])
    assert np.isnan(found[3])


def test_ground_of_triangles_is_scanned_by_rays() -> None:
    world = ground.stairs(as_mesh=True)
    with pytest.raises(AnysimError, match=r"the heights of 'terrain' stand in no table.*use scanned_heights"):
        GroundHeights(world)
    scene = SceneGeometry(world)
    frame = np.array([[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]])
    points = np.array([[-0.9, 0.1], [-0.3, -0.1], [0.25, 0.2], [0.9, 0.0]])
    posed = scene.posed(world.initial_body_pose[None])
    answer = [0.0, 0.2, 0.4, 0.6]
    on_ground = scanned_heights(scene, posed, frame, points, seen=scene.on([WORLD]))
    assert on_ground[0] == pytest.approx(answer, abs=1e-9)


def test_rays_see_what_stands_on_the_ground_and_not_the_robot() -> None:
    s = Sketch("steps")
    s.ground()
    s.fixed("step", Box((0.5, 0.5, 0.1)), (1.0, 0.0, 0.1))
    robot = s.free("robot", Box((0.2, 0.2, 0.2)), (0.0, 0.0, 0.5))
    scene = SceneGeometry(s.world())
    posed = scene.posed(scene.world.initial_body_pose[None])
    frame = scene.world.initial_body_pose[[robot]]
    points = np.array([[0.0, 0.0], [1.0, 0.0]])
    assert scanned_heights(scene, posed, frame, points)[0] == pytest.approx([0.7, 0.2])
    own = scene.without([robot])
    assert scanned_heights(scene, posed, frame, points, seen=own)[0] == pytest.approx([0.0, 0.2])
    assert np.isnan(scanned_heights(scene, posed, frame, points, reach=1.4, seen=own)[0, 0])


def test_a_place_that_is_no_number_has_no_height() -> None:
    frames = np.full((2, 7), np.nan)
    frames[1] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    for world in (ground.hills(as_mesh=False), World(geoms=(Geom("terrain", WORLD, Plane()),))):
        found = GroundHeights(world).at(frames, np.zeros((1, 2)))
        assert np.isnan(found[0])
        assert np.isfinite(found[1])


def test_upright_keeps_the_heading() -> None:
    rng = np.random.default_rng(2)
    frames = frames_over(rng, 50)
    level = upright(frames)
    x, z = np.tile([1.0, 0.0, 0.0], (50, 1)), np.tile([0.0, 0.0, 1.0], (50, 1))
    assert np.abs(P.rotate(level[:, 3:], z) - z).max() < 1e-12
    before, after = P.rotate(frames[:, 3:], x), P.rotate(level[:, 3:], x)
    assert np.abs(np.arctan2(before[:, 1], before[:, 0]) - np.arctan2(after[:, 1], after[:, 0])).max() < 1e-12

"""The depth camera of both kinds, the viewer, and what is drawn into its pictures."""

from typing import Any

import numpy as np
import pytest

from anysim.errors import CapabilityError, TaskError
from anysim.testing.engines import require_drawing
from tests.plugins.legged_gym.simulators import ONE_FIRST, simulator

DEPTH: dict[str, Any] = {"resolution": [29, 20], "position": [0.4, 0.0, 0.0], "pitch": 0.6, "far_plane": 2.0}
HIGH = {"position": [0.0, 0.0, 0.8]}


def plane_depth(height: float, beside: float = 0.0) -> np.ndarray:
    """What a camera of DEPTH sees of a plane, in closed form: along the optical axis, row by row or beside."""
    rows = np.arange(20) + 0.5 - 10 + beside
    tangent = rows / (20 / (2 * np.tan(np.radians(58.0) / 2)))
    drop = np.sin(0.6) + np.cos(0.6) * tangent  # of a point at unit depth
    depth = np.where(drop > 0, height / np.maximum(drop, 1e-9), np.inf)
    return np.clip(depth, 0.1, 2.0)


@pytest.mark.parametrize("engine", ONE_FIRST)
def test_depth_of_rays_is_that_of_a_plane_and_new_after_a_reset(engine: str) -> None:
    with simulator(engine, 2, depth=DEPTH, init_state=HIGH) as sim:
        wanted = np.repeat(plane_depth(0.8)[:, None], 29, axis=1)
        np.testing.assert_allclose(sim.depth_images, [wanted, wanted], atol=1e-5)
        still = np.zeros((2, 3))
        sim.reset_root_states([0, 1], [[0, 0, 1.0], [0, 0, 0.5]], [[0, 0, 0, 1]] * 2, still, still)
        images = sim.depth_images
        np.testing.assert_allclose(images[0, :, 0], plane_depth(1.0), atol=1e-5)
        np.testing.assert_allclose(images[1, :, 0], plane_depth(0.5), atol=1e-5)
        for _ in range(5):
            sim.step(np.zeros((2, 12)))
        np.testing.assert_array_equal(sim.depth_images, images)
        sim.update_sensors()
        assert np.abs(sim.depth_images - images).max() > 0.01
        np.testing.assert_allclose(images[0, :, 0], plane_depth(1.0), atol=1e-5), "what was handed out stays"
        sim.reset_idx([1])
        np.testing.assert_allclose(sim.depth_images[1], wanted, atol=1e-5)


@pytest.mark.parametrize("engine", ONE_FIRST)
def test_native_depth_is_that_of_a_plane_and_new_after_a_reset(engine: str) -> None:
    """Within its row: SAPIEN's picture is off by up to a quarter of one, which is much where there are twenty."""
    require_drawing(engine)
    with simulator(engine, 1, depth={**DEPTH, "source": "native"}, init_state=HIGH) as sim:
        for height in (0.8, 0.5):
            sim.reset_root_states([0], [[0, 0, height]], [[0, 0, 0, 1]], np.zeros((1, 3)), np.zeros((1, 3)))
            found = sim.depth_images[0].T
            assert (found <= plane_depth(height, -0.5) + 1e-3).all()
            assert (found >= plane_depth(height, 0.5) - 1e-3).all()
        if engine != "sapien":
            np.testing.assert_allclose(found, np.repeat(plane_depth(0.5)[None], 29, axis=0), atol=1e-3)


def test_the_viewer_draws_what_is_asked_for() -> None:
    require_drawing("mujoco")
    flags = {
        "debug_draw_height_points_around_base": True,
        "debug_draw_height_points_around_feet": True,
        "debug_draw_key_body_points": True,
        "debug_draw_depth_images": True,
    }
    viewer = {"headless": False, "size": [200, 150], "env": 1}
    with simulator("mujoco", viewer=viewer) as sim:
        assert sim.viewer_image is None
        sim.draw_debug_vis()
        assert sim.viewer_image is None, "no flag, nothing drawn"
        plain = sim.draw_viewer()
        sim.set_viewer_camera([0.0, 0.0, 3.0], [0.01, 0.0, 0.0])
        above = sim.draw_viewer()
        assert (plain != above).any()
    with simulator("mujoco", viewer={**viewer, **flags}, depth=DEPTH, asset={"key_bodies": ["trunk"]}) as sim:
        sim.set_viewer_camera([0.0, 0.0, 3.0], [0.01, 0.0, 0.0])
        sim.draw_debug_vis()
        marked = sim.viewer_image
        assert marked is not None
        colors = [(255, 210, 0), (0, 220, 255), (255, 0, 160)]
        assert [bool((marked == color).all(axis=-1).any()) for color in colors] == [True] * 3
        assert (marked[:20, :29, 0] == marked[:20, :29, 2]).all(), "the depth image is grey"
        # seen from above, x goes up in the picture and y to the left: the trunk is in the middle, three metres below
        place = np.argwhere((marked == colors[2]).all(axis=-1))
        assert np.abs(place.mean(axis=0) - [74.5, 99.5]).max() < 6


def test_what_is_not_there_is_refused() -> None:
    with simulator("null", 1) as sim:
        with pytest.raises(TaskError, match=r"no depth camera; make it with `depth: \{source: rays\}`"):
            _ = sim.depth_images
        sim.update_sensors()
        sim.draw_debug_vis()
        with pytest.raises(TaskError, match=r"no viewer; make it with `viewer: \{headless: false\}`"):
            sim.set_viewer_camera([1, 1, 1], [0, 0, 0])
    with pytest.raises(CapabilityError, match=r"null cannot run .*render: depth"):
        simulator("null", 1, depth={"source": "native"})
    with pytest.raises(TaskError, match=r"near_plane \(3 m\) must be below far_plane \(2 m\)"):
        simulator("null", 1, depth={**DEPTH, "near_plane": 3.0})

"""Kinds of ground, heights beside robots, and levels that envs climb."""

from typing import Any

import numpy as np
import pytest

from anysim.errors import CapabilityError, SpecError, TaskError
from tests.plugins.legged_gym.simulators import ONE_FIRST, simulator

TILES: dict[str, Any] = {
    "kind": "tiles",
    "cell": 0.1,
    "tiles": {
        "columns": ["rough", "stairs"],
        "rows": 3,
        "size": 4.0,
        "border": 1.0,
        "choose": "curriculum",
        "start": 1,
    },
}


@pytest.mark.parametrize("engine", ONE_FIRST)
@pytest.mark.parametrize("mesh_type", ["heightfield", "trimesh"])
def test_robots_stand_on_their_tile(engine: str, mesh_type: str) -> None:
    """The same heights on every engine, whether they are built as a field or as triangles."""
    terrain = {"mesh_type": mesh_type, "ground": TILES}
    if (engine, mesh_type) == ("mujoco", "trimesh"):
        with pytest.raises(CapabilityError, match=r"mujoco cannot run .*triangle mesh.*Choose another engine"):
            simulator(engine, 1, terrain=terrain)
        return
    with simulator(engine, 4, terrain=terrain) as sim:
        assert sim.terrain_origins.shape == (3, 2, 3)
        assert sim.max_terrain_level == 3
        np.testing.assert_array_equal(sim.terrain_types, [0, 0, 1, 1])
        assert set(sim.terrain_levels) <= {0, 1}
        wanted = sim.terrain_origins[sim.terrain_levels, sim.terrain_types]
        np.testing.assert_array_equal(sim.env_origins, wanted)
        np.testing.assert_allclose(sim.base_pos, wanted + sim.base_init_pos, atol=1e-6)
        beneath = np.flatnonzero((sim.height_points == 0).all(axis=1))[0]
        np.testing.assert_allclose(sim.measured_heights[:, beneath], wanted[:, 2], atol=1e-9)
        for _ in range(40):
            sim.step(np.zeros((4, 12)))
        height = sim.feet_pos[..., 2] - sim.heights_around_feet[..., 4]
        assert (np.abs(height - 0.02) < 0.008).all(), "balls of 2 cm on the ground that is measured"
        assert not sim.engine.get_state().fault.any()


def test_heights_turn_with_the_robot() -> None:
    """Against the function that the ground was made of: a slope along x and another along y."""
    x, y = np.meshgrid(np.linspace(-2, 2, 21), np.linspace(-2, 2, 21))
    ground = {"kind": "heightfield", "heights": (0.2 * x - 0.1 * y).tolist(), "size": [4.0, 4.0]}
    points = {"measured_points_x": [-0.3, 0.0, 0.4], "measured_points_y": [-0.2, 0.1]}
    with simulator("null", 1, terrain={"mesh_type": "heightfield", "ground": ground, **points}) as sim:
        yaw = 0.7
        turn = [0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)]
        sim.reset_root_states([0], [[0.5, -0.4, 1.0]], [turn], np.zeros((1, 3)), np.zeros((1, 3)))
        ahead, left = sim.height_points.T
        px = 0.5 + ahead * np.cos(yaw) - left * np.sin(yaw)
        py = -0.4 + ahead * np.sin(yaw) + left * np.cos(yaw)
        np.testing.assert_allclose(sim.measured_heights[0], 0.2 * px - 0.1 * py, atol=1e-9)
        assert sim.height_points.shape == (6, 2)
        np.testing.assert_array_equal(sim.height_points[:2], [[-0.3, -0.2], [-0.3, 0.1]])


def test_levels_rise_and_fall_and_never_leave() -> None:
    with simulator("null", 6, terrain={"mesh_type": "heightfield", "ground": TILES}) as sim:
        every = np.arange(6)
        before = sim.terrain_levels
        up, down = np.array([1, 1, 0, 0, 0, 1], dtype=bool), np.array([0, 0, 1, 1, 0, 1], dtype=bool)
        sim.update_terrain_curriculum(every, up, down)
        np.testing.assert_array_equal(sim.terrain_levels, np.maximum(before + up.astype(int) - down, 0))
        stood = sim.base_pos
        sim.reset_idx([0])
        np.testing.assert_allclose(sim.base_pos[0], sim.env_origins[0] + sim.base_init_pos)
        np.testing.assert_array_equal(sim.base_pos[1:], stood[1:])
        for _ in range(30):
            sim.update_terrain_curriculum(every, np.ones(6, dtype=bool), np.zeros(6, dtype=bool))
        assert 0 <= sim.terrain_levels.min() <= sim.terrain_levels.max() < 3
        with pytest.raises(TaskError, match="one boolean for each of 2 envs"):
            sim.update_terrain_curriculum([0, 1], [True], [False])


def test_ground_that_does_not_fit_is_refused() -> None:
    with simulator("null", 1) as sim, pytest.raises(TaskError, match=r"no levels to climb; .*mesh_type"):
        sim.update_terrain_curriculum([0], [True], [False])
    with pytest.raises(
        SpecError, match=r"terrain\.mesh_type: expected one of plane, heightfield, trimesh; got 'hills'"
    ):
        simulator("null", 1, terrain={"mesh_type": "hills"})
    with pytest.raises(
        SpecError, match=r"terrain\.ground\.kind.*mesh_type plane is built of kind plane; this is tiles"
    ):
        simulator("null", 1, terrain={"mesh_type": "plane", "ground": TILES})


def test_a_mesh_of_a_file_is_measured_by_rays(tmp_path: Any) -> None:
    """A wedge that rises by a half along x."""
    corners = [(-2, -2, -1), (2, -2, 1), (2, 2, 1), (-2, 2, -1)]
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "f 1 2 3\nf 1 3 4\n"
    (tmp_path / "wedge.obj").write_text(text)
    ground = {"kind": "trimesh", "file": str(tmp_path / "wedge.obj")}
    with simulator("null", 2, terrain={"mesh_type": "trimesh", "ground": ground}) as sim:
        place = np.array([[0.3, 0.0, 1.0], [-0.5, 0.2, 0.5]])
        still = np.zeros((2, 3))
        sim.reset_root_states([0, 1], place, [[0, 0, 0, 1]] * 2, still, still)
        wanted = 0.5 * (place[:, None, 0] + sim.height_points[:, 0])
        np.testing.assert_allclose(sim.measured_heights, wanted, atol=1e-6)

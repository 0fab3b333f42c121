"""A room on every engine: its floor, its furniture, its doorway and its walls are where the World has them."""

import numpy as np
import pytest

from anysim import create_simulation
from anysim.compile.world import compile_world
from anysim.testing.engines import require_engine
from anysim_schemas.run import WorldSpec

ROOM = {
    "room": {"size": [4, 3], "furniture": {"table": 1, "chair": 1}, "windows": [{"wall": "north"}], "seed": 1},
    "objects": {"ball": {"source": {"sphere": 0.05}}, "cube": {"source": {"box": [0.08, 0.08, 0.08]}}},
}  # fmt: skip


@pytest.mark.parametrize("name", ["mujoco", "pybullet", "sapien"])
def test_a_room_carries_and_bounds(name: str) -> None:
    require_engine(name)
    world = compile_world(WorldSpec.model_validate(ROOM))
    with create_simulation(name).create_world(world) as engine:
        index = engine.index
        ball, cube, table = (index.body(n) for n in ("ball", "cube", "table"))
        state = np.zeros((1, 2, 7))
        state[..., 6] = 1.0
        state[0, 0, :3] = (0.0, -1.6, 0.06)  # in the doorway, below the lintel
        state[0, 1, :3] = world.bodies[table].position
        top = max(g.position[2] + g.shape.half_size[2] for g in world.geoms if g.body == table)  # type: ignore[union-attr]
        state[0, 1, 2] = top + 0.045
        engine.set_body_state(state, np.zeros((1, 2, 6)), bodies=[ball, cube])
        engine.step(400)
        found = engine.get_state().body_pose[0]
        assert found[ball, 2] == pytest.approx(0.05, abs=1e-3), "on the threshold"
        assert found[cube, 2] == pytest.approx(top + 0.04, abs=1e-3), "on the table"
        starts = np.array([[[0.0, -1.2, 1.0], [1.4, -1.2, 1.0], [0.0, 1.2, 1.5]]])
        hits = engine.raycast(starts, np.array([[[0.0, -1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]]))
        assert hits.distance[0, 0] > 5.0, "through the door"
        assert hits.distance[0, 1] == pytest.approx(0.3, abs=1e-3), "the wall beside it"
        assert hits.distance[0, 2] == pytest.approx(0.3 + 0.06 - 0.006, abs=1e-3), "the pane of the window"
        assert hits.entity[0, 1] == 1 + [e.name for e in world.entities].index("room")

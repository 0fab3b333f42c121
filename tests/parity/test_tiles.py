"""Tiled ground on every engine: it is below each env's origin, and robots stand on it alike wherever that is."""

import numpy as np
import pytest

import anysim
from anysim.engine.capability import Capability
from anysim.testing.engines import require_drawing, require_engine

SPEC = {
    "world": {
        "terrain": {"kind": "tiles", "cell": 0.2, "tiles": {"rows": 3, "size": 6.0, "columns": ["stairs", "rough"]}},
        "robots": {"panda": {"robot": "franka_panda", "position": [0.3, 0.0, 0.0]}},
        "cameras": {"fixed": {"from": [1.5, 0.2, 0.9], "look_at": [0.3, 0.0, 0.5], "size": [48, 36]}},
    },
    "task": {"observations": {"policy": ["last_action", {"term": "height_scan", "frame": "panda"}]}},
}


@pytest.mark.parametrize("name", ["mujoco", "pybullet", "sapien"])
def test_robots_stand_on_their_tiles(name: str) -> None:
    require_engine(name)
    with anysim.make(SPEC, engine=name, num_envs=4, overrides=["world.cameras.fixed.channels=[]"]) as env:
        env.reset(seed=2)
        engine, origin = env.engine, env.scene.origin
        assert len(np.unique(origin, axis=0)) > 2
        above = origin[:, None] + np.array([[-0.5, 0.5, 1.5], [-0.7, -0.4, 1.5]])
        hits = engine.raycast(above, np.tile([0.0, 0.0, -1.0], (4, 2, 1)))
        assert hits.distance == pytest.approx(1.5, abs=1e-3), "on the platform"
        for steps in (0, 50):
            engine.step(steps or 1)
            tool = env.scene.frame("panda.tool")
            env.scene.look(None)
            local = tool.position - origin
            assert local == pytest.approx(np.tile(local[0], (4, 1)), abs=1e-3)
        base = engine.get_state().body_pose[:, engine.index.body("panda")]
        assert base[:, :3] == pytest.approx(origin + np.array([0.3, 0.0, 0.0]), abs=1e-6)
        if Capability.SNAPSHOT_STATE in engine.capabilities:
            kept, before = env.snapshot(), engine.get_state().body_pose.copy()
            env.reset()
            env.reset_to(kept)
            assert engine.get_state().body_pose == pytest.approx(before, abs=1e-9)


@pytest.mark.parametrize("name", ["mujoco", "pybullet", "sapien"])
def test_fixed_cameras_see_the_same_scene_on_every_tile(name: str) -> None:
    """What is fixed to the world moves with the tile: the robot is at the same place in all pictures."""
    require_drawing(name)
    with anysim.make(SPEC, engine=name, num_envs=4) as env:
        env.reset(seed=2)
        seen = env.engine.render("fixed", channels=("segmentation",))["segmentation"] == 1
        assert seen[0].sum() > 60
        for other in seen[1:]:
            assert (other ^ seen[0]).sum() <= 0.03 * seen[0].sum()

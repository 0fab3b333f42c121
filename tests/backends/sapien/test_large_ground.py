"""Large ground from a file: cooked once a process, and the same to the bit as from arrays."""

import time
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.testing.engines import require_engine

GROUND: dict[str, Any] = {
    "engine": "sapien",
    "world": {
        "terrain": {"kind": "tiles", "seed": 3, "tiles": {"rows": 2, "size": 6.0, "columns": ["obstacles", "rough"]}},
        "objects": {"box": {"source": {"box": [0.3, 0.2, 0.1]}, "count": 4}},
        "layout": {"box": {"position": {"range": [[-1.5, -1.5, 0.4], [1.5, 1.5, 0.6]]}}},
    },
    "task": {"observations": {"policy": ["last_action"]}},
}


def fallen() -> np.ndarray:
    """Poses after a second on the ground, in a second episode of each env."""
    with anysim.make(GROUND, num_envs=2) as env:
        env.reset(seed=0)
        env.reset()
        env.engine.step(300)
        return env.engine.get_state().body_pose.copy()


def test_a_file_is_the_same_ground_as_arrays(monkeypatch: pytest.MonkeyPatch) -> None:
    require_engine("sapien")
    from anysim_sapien import large_ground

    monkeypatch.setattr(large_ground, "LARGE", 10**9)
    arrays = fallen()
    monkeypatch.setattr(large_ground, "LARGE", 1000)
    assert (fallen() == arrays).all()
    assert arrays[..., 2].max() < 0.5, "they lie on the ground"


def test_a_file_is_cooked_once() -> None:
    """A scene is built at each reset."""
    require_engine("sapien")
    from anysim_sapien.hulls import UNIT_SCALE
    from anysim_sapien.large_ground import ground_files
    from anysim_sapien.library import physx

    ground = {"kind": "rough", "size": [40, 40], "seed": 11}  # of no other test
    (file,) = ground_files(anysim.compile_world({"world": {"terrain": ground}})).values()
    seconds: list[float] = []
    for _ in range(2):
        began = time.perf_counter()
        physx.PhysxCollisionShapeTriangleMesh(file, UNIT_SCALE, physx.PhysxMaterial(0.8, 0.8, 0.0))
        seconds.append(time.perf_counter() - began)
    assert seconds[1] < 0.1 * seconds[0]

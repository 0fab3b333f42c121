"""Bits of an env: the same alone and among others, and however many threads share them."""

import numpy as np
import pytest

from anysim.math import pose as P
from anysim_sensors.scene import SceneGeometry
from tests.plugins.sensors import worlds

N = 16


@pytest.mark.parametrize("count", [60, 200])
@pytest.mark.parametrize("query", ["rays", "distances"])
def test_an_envs_bits_do_not_depend_on_the_batch_or_on_threads(count: int, query: str) -> None:
    rng = np.random.default_rng(count)
    world = worlds.crowd(rng, count)
    scene = SceneGeometry(world)
    moved = np.repeat(world.initial_body_pose[None], N, axis=0)
    moved[..., :3] += rng.normal(size=(N, len(world.bodies), 3)) * 0.2
    frames = np.column_stack([rng.uniform([-1, -1, 0], [1, 1, 2], (N, 3)), P.normalize(rng.normal(size=(N, 4)))])
    rows = rng.normal(size=(N, 500, 3))
    sets = (np.zeros_like(rows), rows) if query == "rays" else (rows,)
    ask = getattr(scene, query)
    posed = scene.posed(moved)
    whole = ask(posed, frames, *sets, normals=True)
    for threads in (2, 3):
        shared = ask(posed, frames, *sets, normals=True, threads=threads)
        assert all(a.tobytes() == b.tobytes() for a, b in zip(whole, shared, strict=True))
    for e in (0, 7, 15):
        alone = ask(scene.posed(moved[[e]]), frames[[e]], *(s[[e]] for s in sets), normals=True)
        assert all(a[0].tobytes() == b[e].tobytes() for a, b in zip(alone, whole, strict=True))
        same = ask(scene.posed(moved[[e]]), frames[[e]], *(s[e] for s in sets), normals=True)
        assert all(a[0].tobytes() == b[e].tobytes() for a, b in zip(same, whole, strict=True))

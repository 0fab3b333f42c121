"""Resting poses against another implementation of the same method."""

from pathlib import Path

import numpy as np
import pytest

from anysim.math import pose as P
from anysim.placement.context import PlacementContext
from tests.placement.helpers import Layouts


@pytest.mark.parametrize("seed", range(4))
def test_poses_of_a_hull_are_those_of_trimesh(seed: int, tmp_path: Path) -> None:
    pytest.importorskip("networkx", reason="trimesh finds stable poses with it")
    import trimesh
    from trimesh.poses import compute_stable_poses

    points = np.random.default_rng(seed).normal(size=(14, 3)) * [0.02, 0.03, 0.04]
    hull = trimesh.convex.convex_hull(points)
    hull.export(tmp_path / "hull.ply")
    world = Layouts({"a": {"source": {"mesh": str(tmp_path / "hull.ply")}}}, {"a": {"on": "table"}}, 1).world
    own = PlacementContext(world).resting("a")
    transforms, shares = compute_stable_poses(hull, sigma=0.0, threshold=0.0)
    theirs = {tuple(np.round(-t[2, :3], 3)): share for t, share in zip(transforms, shares, strict=True)}
    down = [P.rotate_inverse(np.array(pose.quaternion), np.array([0.0, 0.0, -1.0])) for pose in own]
    assert sum(pose.share for pose in own) == pytest.approx(1.0)
    for normal in down:
        nearest = min(theirs, key=lambda n: float(np.linalg.norm(np.array(n) - normal)))
        assert np.linalg.norm(np.array(nearest) - normal) < 5e-3
    likeliest = max(theirs, key=lambda n: theirs[n])
    assert np.linalg.norm(np.array(likeliest) - down[0]) < 5e-3
    assert own[0].share == pytest.approx(theirs[likeliest], abs=0.1), "poses that hardly stand are left out here"


def test_a_cylinder_stands_and_a_capsule_lies() -> None:
    world = Layouts(
        {"a": {"source": {"cylinder": [0.03, 0.08]}}, "b": {"source": {"capsule": [0.02, 0.08]}}},
        {"a": {"on": "table"}, "b": {"on": "table"}},
        1,
    ).world
    context = PlacementContext(world)
    up = [P.rotate(np.array(p.quaternion), np.array([0.0, 0.0, 1.0]))[2] for p in context.resting("a")]
    assert np.allclose(np.abs(up), 1.0)
    (lying,) = context.resting("b")
    assert abs(P.rotate(np.array(lying.quaternion), np.array([0.0, 0.0, 1.0]))[2]) < 1e-9

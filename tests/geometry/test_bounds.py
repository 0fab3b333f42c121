"""Bounds against sampled surfaces; entities as one shape; the ground below a rectangle; tables and audits."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from anysim.errors import NameLookupError
from anysim.geometry.bounds import EntityShape, ground_top, shape_bounds
from anysim.geometry.triangles import convex_hull
from anysim.math import pose as P
from anysim.model.world import (
    Box,
    Capsule,
    Cylinder,
    Geom,
    HeightField,
    HeightFieldShape,
    Mesh,
    MeshShape,
    Plane,
    Sphere,
    World,
)

Make = Callable[..., World]


def surface(shape: object, rng: np.random.Generator, count: int = 40_000) -> np.ndarray:
    """Points on a shape, dense enough for its extremes."""
    u = rng.normal(size=(count, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    z = rng.uniform(-1, 1, size=count)
    match shape:
        case Box(half):
            return np.sign(rng.normal(size=(count, 3))) * half
        case Sphere(r):
            return u * r
        case Capsule(r, h):
            return u * r + np.array([0, 0, 1]) * (np.sign(z) * h)[:, None]
        case Cylinder(r, h):
            flat = u[:, :2] / np.linalg.norm(u[:, :2], axis=1, keepdims=True) * r
            return np.column_stack([flat, np.sign(z) * h])
    raise AssertionError


@pytest.mark.parametrize("shape", [Box((0.1, 0.2, 0.3)), Sphere(0.2), Capsule(0.1, 0.3), Cylinder(0.2, 0.1)])
def test_bounds_are_exact(shape: Box | Sphere) -> None:
    rng = np.random.default_rng(0)
    points = surface(shape, rng)
    poses = np.concatenate([rng.normal(size=(6, 3)), rng.normal(size=(6, 4))], axis=1)
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    low, high = shape_bounds(shape, poses, {})
    for i, pose in enumerate(poses):
        moved = pose[:3] + P.rotate(pose[3:], points)
        np.testing.assert_allclose(low[i], moved.min(axis=0), atol=2e-3)
        np.testing.assert_allclose(high[i], moved.max(axis=0), atol=2e-3)
        assert (low[i] <= moved.min(axis=0) + 1e-12).all()


def test_bounds_of_a_mesh() -> None:
    vertices, faces = convex_hull(np.random.default_rng(0).normal(size=(50, 3)), 64)
    pose = P.pose((1, 2, 3), tuple(P.from_roll_pitch_yaw(np.array([0.3, 0.4, 0.5]))))
    low, high = shape_bounds(MeshShape("m"), np.tile(pose, (2, 1)), {"m": Mesh("m", vertices, faces)})
    moved = pose[:3] + P.rotate(pose[3:], vertices)
    np.testing.assert_allclose(low, np.tile(moved.min(axis=0), (2, 1)))
    np.testing.assert_allclose(high, np.tile(moved.max(axis=0), (2, 1)))
    with pytest.raises(ValueError, match="Plane has no bounds"):
        shape_bounds(Plane(), pose, {})


def test_an_entity_is_one_shape_at_its_initial_joints(panda: World) -> None:
    arm = EntityShape(panda, "panda")
    low, high = arm.bounds(np.array([0, 0, 0, 0, 0, 0, 1.0]))
    assert 0.19 < low[2] + 0.2 < 0.21  # stands on its base
    assert 0.5 < high[0] < 0.7
    turned = P.pose((0, 0, 1), tuple(P.from_roll_pitch_yaw(np.array([0, 0, np.pi]))))
    low_turned, high_turned = arm.bounds(turned)
    np.testing.assert_allclose(low_turned[0], -high[0], atol=1e-9)
    assert arm.top_height(turned) == pytest.approx(high[2] + 1)
    assert arm.radius >= np.linalg.norm([high[0], 0, high[2]]) - 1e-9
    assert high_turned[2] == arm.top_height(turned)
    with pytest.raises(NameLookupError, match="there is no entity 'pand'; did you mean 'panda'"):
        EntityShape(panda, "pand")


def test_what_does_not_collide_is_measured_by_its_looks(world: Make) -> None:
    made = world(objects={"ghost": {"source": {"sphere": 0.3}, "collides": False}})
    assert EntityShape(made, "ghost").bounds(np.array([0, 0, 0, 0, 0, 0, 1.0]))[0][2] == pytest.approx(-0.3)


def test_ground_below_rectangles() -> None:
    rng = np.random.default_rng(0)
    field = HeightField("h", rng.uniform(0, 1, size=(9, 6)), (2.0, 4.0))
    geom = Geom("terrain", -1, HeightFieldShape("h"), position=(0.3, -0.2, 0.1))
    world = replace(World(), geoms=(geom,), heightfields=(field,))
    low = rng.uniform(-2, 1, size=(10, 2))
    high = low + rng.uniform(0, 1.5, size=(10, 2))
    found = ground_top(world, low, high)
    for i in range(10):
        grid = np.stack(np.meshgrid(*(np.linspace(low[i, k], high[i, k], 60) for k in (0, 1))), axis=-1).reshape(-1, 2)
        sampled = ground_top(world, grid, grid).max()
        assert sampled - 1e-12 <= found[i] <= sampled + 0.05
    assert ground_top(world, np.array([-50.0, -50.0]), np.array([-50.0, -50.0])) == 0, "there is no ground out there"
    np.testing.assert_array_equal(ground_top(World(), low, high), np.zeros(10))

"""Rays and contact points."""

from typing import Any

import numpy as np
import pytest

from anysim.model.world import Body, BodyKind, Box, Geom


def test_rays_hit_the_nearest_and_name_it(worlds, make):
    """Distance, entity, ground, nothing; per env, in the order asked for."""
    engine = make(worlds.scene(), 2)
    engine.set_body_state([[[3.0, 3.0, 0.5, 0.0, 0.0, 0.0, 1.0]]], env_ids=[1], bodies=[1])
    origins = np.tile([[1.0, 0.0, 2.0], [3.0, 3.0, 2.0], [0.0, 1.0, 2.0], [0.0, 0.0, 2.0]], (2, 1, 1))
    directions = np.tile([[0.0, 0.0, -1.0], [0.0, 0.0, -2.0], [0.0, 0.0, -0.1], [0.0, 0.0, 1.0]], (2, 1, 1))
    hits = engine.raycast(origins, directions)
    box, arm = engine.index.segmentation_id("box"), engine.index.segmentation_id("arm")
    assert hits.entity.tolist() == [[box, 0, arm, -1], [0, box, arm, -1]]
    assert np.allclose(hits.distance, [[1.8, 2.0, 1.4, np.inf], [2.0, 1.4, 1.4, np.inf]])
    swapped = engine.raycast(origins, directions, [1, 0])
    assert np.array_equal(swapped.entity, hits.entity[::-1])


def test_rays_see_collision_geometry_only(worlds, make):
    """A picture of a wall stops no ray; an invisible wall does, even a transparent one."""
    world = worlds.ball(5.0)
    looks: list[tuple[str, float, Any]] = [
        ("picture", 1.0, {"collides": False}),
        ("glass", 2.0, {"visible": False}),
        ("clear", 3.0, {"color": (1.0, 1.0, 1.0, 0.0)}),
    ]
    for name, x, kwargs in looks:
        body = Body(name, BodyKind.STATIC, position=(x, 0.0, 0.5))
        world = worlds.with_body(world, body, Geom(name, 0, Box((0.1, 0.1, 0.1)), **kwargs))
    engine = make(world)
    origins = np.array([[[1.0, 0.0, 2.0], [2.0, 0.0, 2.0], [3.0, 0.0, 2.0]]])
    hits = engine.raycast(origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape))
    assert hits.entity[0].tolist() == [0, engine.index.segmentation_id("glass"), engine.index.segmentation_id("clear")]


def test_contacts_add_up_to_the_weight(worlds, make):
    """Forces on b, normals from a to b, depth positive, per env."""
    engine = make(worlds.scene(), 3)
    engine.step(1500)
    engine.set_body_state([[[1.0, 0.0, 3.0, 0.0, 0.0, 0.0, 1.0]]], env_ids=[1], bodies=[1])
    found = engine.contacts([2, 1])
    assert set(found.env.tolist()) == {1, 2}
    box = (found.env == 2) & (found.body_b == 1)
    assert (found.body_a[box] == -1).all()
    assert np.allclose(found.normal[box], [0.0, 0.0, 1.0])
    assert found.force[box].sum(axis=0)[2] == pytest.approx(9.81, rel=1e-4)
    assert (found.depth[box] > 0).all()
    assert np.allclose(found.position[box][:, 2], 0.0, atol=1e-3)
    assert not (found.body_b[found.env == 1] == 1).any()


def test_no_contacts_are_empty_arrays(worlds, make):
    """Right shapes for nothing."""
    found = make(worlds.ball(1.0), 2).contacts()
    assert found.force.shape == (0, 3)
    assert found.env.shape == (0,)


def test_contacts_know_the_commands_that_wait(worlds, make):
    """A target written after the last step is part of the forces asked for, and asking twice is the same."""
    world = worlds.scene()
    engine = make(world)
    engine.step(200)
    first = engine.contacts()
    again = engine.contacts()
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))

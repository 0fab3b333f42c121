"""Visible solids of a World: what a body looks like, in its own frame."""

import numpy as np

from anysim.model.shapes import Box, Plane, Sphere
from anysim.model.world import HeightField
from anysim.testing.ground import field_triangles
from anysim.testing.sketch import Sketch
from anysim_viewer.solids import Solids, alike, built_looks, relief


def test_triangles_stand_where_their_geoms_do() -> None:
    s = Sketch("one")
    s.free("box", Box((0.1, 0.2, 0.3)), (0.0, 0.0, 1.0))
    s.free("ball", Sphere(0.05), (1.0, 0.0, 1.0))
    world = s.world()
    made = Solids(world)
    looks = built_looks(world)
    (box,) = made.of(world.body_geoms[0], looks)
    np.testing.assert_allclose(np.ptp(box.vertices, axis=0), [0.2, 0.4, 0.6])
    assert not box.look.smooth
    (ball,) = made.of(world.body_geoms[1], looks)
    np.testing.assert_allclose(np.linalg.norm(ball.vertices, axis=1), 0.05, atol=1e-9)
    assert ball.look.smooth


def test_what_looks_alike_is_one_and_what_does_not_is_not() -> None:
    s = Sketch("many")
    for k in range(4):
        s.free(f"box{k}", Box((0.1, 0.1, 0.1 if k < 3 else 0.2)), (float(k), 0.0, 1.0))
    world = s.world()
    assert alike(world, built_looks(world), 3) == {0: (0, 1, 2)}
    looks = built_looks(world)
    looks.color[1] = [1.0, 0.0, 0.0, 1.0]
    assert alike(world, looks, 2) == {0: (0, 2)}
    assert Solids(world).of(world.body_geoms[1], looks)[0].look.color == (255, 0, 0)


def test_a_plane_is_as_large_as_it_is_drawn() -> None:
    s = Sketch("flat")
    world = s.world()
    planes = [n for n, geom in enumerate(world.geoms) if isinstance(geom.shape, Plane)]
    solids = Solids(world).of(planes, built_looks(world))
    shapes = [world.geoms[n].shape for n in planes]
    size = max((shape.visual_size for shape in shapes if isinstance(shape, Plane)), default=0.0)
    assert all(np.abs(solid.vertices[:, :2]).max() == size for solid in solids)


def test_ground_is_cut_as_the_conventions_say() -> None:
    field = HeightField("ground", np.random.default_rng(3).uniform(size=(4, 6)), (3.0, 2.0))
    for ours, theirs in zip(relief(field), field_triangles(field), strict=True):
        np.testing.assert_array_equal(ours, theirs)

"""The built model has the World's frames, order and collisions."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.errors import EngineError
from anysim.model.world import (
    Body,
    BodyKind,
    Box,
    Geom,
    HeightField,
    HeightFieldShape,
    Inertial,
    Mesh,
    MeshShape,
    Plane,
    Sphere,
    World,
)


def test_initial_state_is_the_worlds(worlds, make):
    """Frames are those of the World, not those of its inertias, and nothing has exerted or touched anything yet."""
    world = worlds.scene()
    state = make(world, 2).get_state()
    assert np.allclose(state.body_pose, world.initial_body_pose, atol=1e-12)
    assert np.array_equal(state.joint_pos, [[0.3, -0.4]] * 2)
    assert not state.joint_effort.any()
    assert not state.contact_force.any()
    assert not state.fault.any()


def test_masses_and_inertias_are_the_worlds(worlds, make):
    """Read back from the live model, full inertia included."""
    world = worlds.scene()
    engine = make(world)
    assert np.array_equal(engine.get_parameters("body.mass")[0], [b.inertial.mass for b in world.bodies])
    assert np.array_equal(engine.get_parameters("body.com")[0], [b.inertial.com for b in world.bodies])
    assert np.allclose(engine.get_parameters("body.inertia")[0], [b.inertial.inertia for b in world.bodies], atol=1e-15)


def test_a_refusal_carries_mujocos_words_and_the_body(worlds, make):
    """A moving body of less mass than MuJoCo takes: its message, with the World's name."""
    world, feather = worlds.scene(), Inertial(1e-16, inertia=(1e-17, 1e-17, 1e-17, 0.0, 0.0, 0.0))
    bodies = (replace(world.bodies[0], name="feather", inertial=feather), *world.bodies[1:])
    with pytest.raises(
        EngineError, match=r"cannot build the world 'scene'.*mass and inertia of moving bodies.*'feather'"
    ):
        make(replace(world, bodies=bodies))


def test_an_impossible_inertia_is_refused_by_name(worlds, make):
    """The triangle inequality, with the moments in the message."""
    world = worlds.scene()
    bodies = (
        world.bodies[0],
        replace(world.bodies[1], inertial=Inertial(1.0, inertia=(1.0, 0.1, 0.1, 0, 0, 0))),
        *world.bodies[2:],
    )
    with pytest.raises(EngineError, match=r"inertia of body 'box' belongs to no rigid body"):
        make(replace(world, bodies=bodies))


def test_a_body_may_be_called_world(make):
    """MuJoCo's own name for the world is no trouble."""
    world = World(bodies=(Body("world", BodyKind.FREE, inertial=Inertial(1.0, inertia=(0.1, 0.1, 0.1, 0, 0, 0))),))
    engine = make(world)
    engine.step(10)
    assert engine.get_state().body_pose[0, 0, 2] < 0


def test_a_base_and_its_first_link_never_collide(worlds, make):
    """Parent and child, although the parent is fixed to the world."""
    world = worlds.scene()
    overlapping = [replace(g, shape=Box((0.15, 0.15, 0.15))) if g.name in ("base", "upper") else g for g in world.geoms]
    pairs = make(replace(world, geoms=tuple(overlapping))).contacts()
    assert not ((pairs.body_a == 2) & (pairs.body_b == 3)).any()
    assert not ((pairs.body_a == 3) & (pairs.body_b == 2)).any()


def test_excluded_pairs_pass_through_each_other(worlds, make):
    """The ball falls through a box under it only if the pair is excluded."""
    half = (0.1, 0.1, 0.1)
    world = worlds.with_body(
        worlds.ball(0.5), Body("box", BodyKind.STATIC, position=(0.0, 0.0, 0.1)), Geom("box", 0, Box(half))
    )
    heights = []
    for pairs in (frozenset(), frozenset({(0, 1)})):
        engine = make(replace(world, excluded_pairs=pairs))
        engine.step(1000)
        heights.append(engine.get_state().body_pose[0, 0, 2])
    assert heights[0] == pytest.approx(0.25, abs=1e-3)
    assert heights[1] == pytest.approx(0.05, abs=1e-3)


def test_static_bodies_are_placed_per_env(worlds, make):
    """A pedestal's pose is an env's own, holds over steps, and returns with a reset; its links go along."""
    world = worlds.scene()
    engine = make(world, 3)
    start = engine.get_state().body_pose.copy()
    engine.set_body_state([[[1.0, 2.0, 0.9, 0.0, 0.0, 0.0, 1.0]]], env_ids=[1], bodies=[2])
    moved = engine.get_state().body_pose
    assert np.allclose(moved[1, 2], [1.0, 2.0, 0.9, 0.0, 0.0, 0.0, 1.0])
    assert np.abs(moved[1, 3, :3] - start[1, 3, :3]).max() > 0.5
    assert np.array_equal(moved[[0, 2]], start[[0, 2]])
    engine.step(20)
    assert np.array_equal(engine.get_state().body_pose[1, 2], moved[1, 2])
    engine.reset([1])
    assert np.array_equal(engine.get_state().body_pose[1], start[1])


def test_height_fields_have_row_0_at_the_lowest_y(make):
    """Heights where the World has them, also below zero."""
    heights = np.zeros((5, 9))
    heights[0, 8] = 0.7  # y = -1, x = 2
    heights[4, 0] = -0.3  # y = 1, x = -2
    world = World(
        geoms=(Geom("hills", -1, HeightFieldShape("f")),), heightfields=(HeightField("f", heights, (4.0, 2.0)),)
    )
    origins = np.array([[[1.999, -0.999, 3.0], [-1.999, 0.999, 3.0], [0.0, 0.0, 3.0]]])
    hits = make(world).raycast(origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape))
    assert np.allclose(3.0 - hits.distance, [[0.7, -0.3, 0.0]], atol=5e-3)
    assert (hits.entity == 0).all()


def test_a_flat_height_field_is_a_floor(worlds, make):
    """No relief at all is legal."""
    flat = HeightField("flat", np.full((4, 4), 0.25), (4.0, 4.0))
    world = worlds.ball(0.5)
    world = replace(world, geoms=(Geom("flat", -1, HeightFieldShape("flat")), world.geoms[1]), heightfields=(flat,))
    engine = make(world)
    engine.step(1500)
    assert engine.get_state().body_pose[0, 0, 2] == pytest.approx(0.30, abs=1e-3)


def _pyramid() -> Mesh:
    """Off its frame's origin, so that a mesh put about its own centre would show."""
    vertices = np.array([[0.3, 0.0, 0.0], [0.5, 0.0, 0.0], [0.3, 0.2, 0.0], [0.3, 0.0, 0.2]])
    return Mesh("pyramid", vertices, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.int32))


def test_meshes_are_where_their_vertices_are(make):
    """A mesh from memory, on a body, hit by rays at its faces."""
    world = World(
        bodies=(Body("m", BodyKind.STATIC, position=(0.0, 0.0, 1.0)),),
        geoms=(Geom("m", 0, MeshShape("pyramid")),),
        meshes=(_pyramid(),),
    )
    origins = np.array([[[0.31, 0.01, 3.0], [0.0, 0.0, 3.0]]])
    hits = make(world).raycast(origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape))
    assert hits.distance[0, 0] == pytest.approx(2.0 - 0.18, abs=1e-5)
    assert np.isinf(hits.distance[0, 1])


def test_a_flat_visual_mesh_is_accepted(make):
    """A sticker has no volume."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    sheet = Mesh("sheet", corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    world = World(geoms=(Geom("s", -1, MeshShape("sheet"), collides=False),), meshes=(sheet,))
    make(world).step()


def test_a_closed_limit_on_one_side(worlds, make):
    """One finite limit holds, the other side is free."""
    engine = make(worlds.hinge(mode="effort", upper=0.2))
    engine.set_control(effort=[[1.0]])
    engine.step(1500)
    assert engine.get_state().joint_pos[0, 0] == pytest.approx(0.2, abs=1e-3)
    engine.set_control(effort=[[-1.0]])
    engine.step(1500)
    assert engine.get_state().joint_pos[0, 0] < -10


def test_planes_stand_where_they_are_put(worlds, make):
    """Position and orientation of the ground."""
    world = worlds.ball(1.0)
    ground = Geom("ground", -1, Plane(), position=(0.0, 0.0, 0.4))
    engine = make(replace(world, geoms=(ground, world.geoms[1])))
    engine.step(1500)
    assert engine.get_state().body_pose[0, 0, 2] == pytest.approx(0.45, abs=1e-3)


def test_limits_and_volumes_are_read_back(worlds, make):
    """From the compiled model: open sides are infinite, what does not collide has no volume."""
    world = worlds.scene()
    world = replace(
        world,
        geoms=(*world.geoms, Geom("mesh", 4, MeshShape("pyramid")), Geom("picture", 4, Box((1, 1, 1)), collides=False)),
        meshes=(_pyramid(),),
    )
    found = make(world).read_back()
    assert found["joint.limits"].tolist() == [[-2.0, 2.0], [-np.inf, np.inf]]
    ball, box, capsule = 4 / 3 * np.pi * 0.05**3, 0.008, np.pi * 0.03**2 * 0.3 + 4 / 3 * np.pi * 0.03**3
    wanted = [0.0, ball, box, box, capsule, 8 * 0.1 * 0.02 * 0.02, 0.2**3 / 6, 0.0]
    assert np.allclose(found["geom.volume"], wanted, rtol=1e-5)


def test_options_that_do_not_exist(make, worlds):
    """The nearest and all of them."""
    with pytest.raises(EngineError, match=r"no option 'thread'; did you mean 'threads'"):
        make(worlds.ball(), thread=2)
    with pytest.raises(EngineError, match="options of mujoco"):
        make(worlds.ball(), integrator="leapfrog")


def test_a_crowd_asks_for_the_memory_that_it_takes(make):
    """MuJoCo's own estimate for 1,001 free bodies is 1.8 GB, and fails where there is not as much."""
    ball = Inertial(1.0, inertia=(0.01, 0.01, 0.01, 0.0, 0.0, 0.0))
    bodies = tuple(Body(str(i), kind=BodyKind.FREE, position=(0.1 * i, 0.0, 0.04), inertial=ball) for i in range(1001))
    geoms = tuple(Geom(str(i), i, Sphere(0.05)) for i in range(1001))
    engine = make(World("crowd", bodies=bodies, geoms=(Geom("ground", -1, Plane()), *geoms)))
    assert engine._sims.model.narena < 200e6
    engine.step(1)
    assert not engine.get_state().fault.any()

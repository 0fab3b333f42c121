"""Traps: what Bullet does unless it is told otherwise. Each test fails without the guard that its docstring names."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import anysim_pybullet
from anysim.math import pose as P
from anysim.model.world import Box, Capsule, Geom, HeightField, HeightFieldShape, MeshShape, Sphere
from anysim.testing import worlds
from anysim.testing.compare import assert_same, play, read, spread, tape
from anysim.testing.sketch import Sketch
from anysim_pybullet.bullet import bullet
from anysim_pybullet.urdf import roll_pitch_yaw, world_geom_urdf


def _client(engine):
    return engine._envs.clients[0]


@pytest.mark.parametrize("call", ["loadMJCF", "loadSoftBody", "loadSDF"])
def test_calls_that_crash_are_not_made(call):
    """Bullet's own MJCF reader makes bodies that crash the audit's query; soft bodies crash without their file."""
    for file in Path(anysim_pybullet.__file__).parent.glob("*.py"):
        assert call not in file.read_text("utf-8"), file.name


def test_numbers_of_numpy_are_written_as_numbers():
    """`float` before `repr`: Bullet reads a capsule of radius `np.float64(0.1)` as a ball, without a word."""
    radius, half = 0.1, 0.2
    text = world_geom_urdf(Geom("limb", -1, Capsule(np.float64(radius), np.float64(half))), {})
    assert text == world_geom_urdf(Geom("limb", -1, Capsule(radius, half)), {})


def test_the_past_decides_nothing(build, own):
    """`deterministicOverlappingPairs`: without ordered pairs the order in which they met is the order of the solver."""
    one, other = build(own.pile()), build(own.pile())
    one.step(500)
    snapshot = one.snapshot()
    other.step(444)
    other.restore(snapshot)
    for engine in (one, other):
        engine.step(500)
    assert_same(read(other), read(one), "a pile of boxes and balls")


def test_what_moved_before_does_not_matter(build):
    """The simple broad phase, and parting before a restore: else the contact with the table begins earlier."""
    used, fresh = build(worlds.scene()), build(worlds.scene())
    used.step(20)
    used.reset()
    for k in range(12):
        used.step()
        fresh.step()
        assert_same(read(used), read(fresh), f"{k + 1} steps after a reset")


def test_masses_are_the_worlds(build, own):
    """Links without `<inertial>` get 1 kg; links of further shapes are written with none."""
    engine = build(own.compounds())
    env, p = _client(engine), bullet()
    for tree, uid in zip(env.plan.trees, env.root_ids, strict=True):
        links = range(-1, p.getNumJoints(uid, physicsClientId=env.id))
        masses = [p.getDynamicsInfo(uid, link, physicsClientId=env.id)[0] for link in links]
        wanted = [engine.world.bodies[b].inertial.mass for b in tree.bodies]
        assert len(masses) == 3
        assert sum(masses) == pytest.approx(sum(wanted), rel=1e-12)


def test_inertias_are_the_worlds(build, own):
    """URDF_USE_INERTIA_FROM_FILE: else they are made from the shapes. Full tensors go by their principal axes."""
    engine = build(own.skew_arm(free=True))
    env, p = _client(engine), bullet()
    for i, body in enumerate(engine.world.bodies):
        info = p.getDynamicsInfo(*env.body_at[i], physicsClientId=env.id)
        axes = np.array(p.getMatrixFromQuaternion(info[4])).reshape(3, 3)
        xx, yy, zz, xy, xz, yz = body.inertial.inertia
        wanted = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert np.allclose(axes @ np.diag(info[2]) @ axes.T, wanted, rtol=1e-9, atol=1e-12)
        anchor = env.plan.frames.anchor[i]
        assert np.allclose(np.array(info[3]) + anchor, body.inertial.com, atol=1e-12)


def test_a_new_mass_keeps_the_inertia(build):
    """A mass alone makes Bullet compute the moments from the shape again."""
    engine = build(worlds.resting(Box((0.1, 0.2, 0.3)), 0.3, 1.0, inertia=None))
    env = _client(engine)
    before = bullet().getDynamicsInfo(*env.body_at[0], physicsClientId=env.id)[2]
    engine.set_parameters("body.mass", [[3.0]])
    info = bullet().getDynamicsInfo(*env.body_at[0], physicsClientId=env.id)
    assert info[0] == 3.0
    assert np.allclose(info[2], before, rtol=1e-12)


def test_joints_begin_without_a_motor(build):
    """Every joint begins with a motor that holds it."""
    engine = build(worlds.slider(drive=False))
    engine.set_joint_state(velocity=1.0)
    engine.step(100)
    assert engine.get_state().joint_vel[0, 0] == pytest.approx(1.0, rel=1e-9)


def test_speeds_beyond_a_hundred(build):
    """Bullet cuts velocities at 100 m/s or rad/s unless it is told another limit."""
    engine = build(worlds.slider(drive=False))
    engine.set_joint_state(velocity=250.0)
    engine.step()
    assert engine.get_state().joint_vel[0, 0] == pytest.approx(250.0, rel=1e-9)
    ball = build(worlds.spinning_ball())
    ball.set_body_state(twist=[0.0, 0.0, 0.0, 0.0, 0.0, 300.0])
    ball.step()
    assert ball.get_state().body_twist[0, 0, 5] == pytest.approx(300.0, rel=1e-9)


def test_poses_are_not_those_of_centres_of_mass(build):
    """Bullet's root poses are those of the principal axes at the centre of mass, read and written."""
    engine = build(worlds.drifting((0.1, -0.05, 0.2)))
    wanted = np.array([1.0, 2.0, 3.0, 0.5, 0.5, 0.5, 0.5])
    engine.set_body_state(pose=wanted)
    env = _client(engine)
    place = bullet().getBasePositionAndOrientation(env.root_ids[0], physicsClientId=env.id)[0]
    assert np.linalg.norm(np.array(place) - wanted[:3]) == pytest.approx(np.linalg.norm([0.1, 0.05, 0.2]))
    engine._envs.mirror.stepped(0, sound=True)  # read from Bullet, not from what was written
    assert np.allclose(engine.get_state().body_pose[0, 0], wanted, atol=1e-12)


def test_height_fields_are_not_centred(build):
    """Bullet puts the middle between the lowest and the highest point at the frame."""
    s = Sketch("field")
    heights = np.zeros((11, 11))
    heights[:, 6:] = 1.0
    s.more["heightfields"] = (HeightField("f", heights, (4.0, 4.0)),)
    s.geoms.append(Geom("terrain", -1, HeightFieldShape("f"), position=(0.0, 0.0, 0.3)))
    engine = build(s.world())
    hits = engine.raycast([[[-1.0, 0.5, 5.0], [1.0, 0.5, 5.0]]], [[[0.0, 0.0, -1.0]] * 2])
    assert np.allclose(hits.distance, [[4.7, 3.7]], atol=1e-3)
    assert (hits.entity == 0).all()


def test_meshes_are_written_as_obj(build):
    """One .glb or .ply in a URDF and Bullet refuses the whole file: whatever a mesh was, it becomes an .obj."""
    world = worlds.resting_mesh()
    meshes = (replace(world.meshes[0], name="part.glb"),)
    geoms = (world.geoms[0], replace(world.geoms[1], shape=MeshShape("part.glb")))
    engine = build(replace(world, meshes=meshes, geoms=geoms))
    assert [f.name for f in engine._envs.plan.folder.glob("m*")] == ["m0.obj"]
    hit = engine.raycast([[[0.1, 0.1, 3.0]]], [[[0.0, 0.0, -1.0]]])
    assert hit.distance[0, 0] == pytest.approx(3.0 - 0.202, abs=2e-3)


def test_lines_are_short(build, own):
    """Bullet's reader keeps a line in a buffer of fixed length."""
    plan = build(own.skew_arm(free=True))._envs.plan
    for file in plan.folder.glob("*.urdf"):
        assert max(len(line) for line in file.read_text("ascii").splitlines()) < 200


def test_friction_of_a_pair_is_not_a_product(build):
    """Bullet multiplies: 0.5 and 0.5 would give 0.25."""
    engine = build(worlds.resting(Box((0.2, 0.2, 0.05)), 0.05))
    engine.set_parameters("geom.friction", [[0.5, 0.5]])
    engine.step(100)
    engine.set_body_state(twist=[2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    engine.step(100)
    assert 2.0 - engine.get_state().body_twist[0, 0, 0] == pytest.approx(0.5 * 9.81 * 0.2, rel=0.02)


def test_bodies_do_not_slow_down(build):
    """Bullet damps bodies by 4 % a second unless told otherwise."""
    engine = build(worlds.spinning_ball())
    engine.set_body_state(twist=[5.0, 0.0, 0.0, 0.0, 0.0, 5.0])
    engine.step(500)
    assert np.allclose(engine.get_state().body_twist[0, 0], [5.0, 0, 0, 0, 0, 5.0], rtol=1e-9)


def test_cylinders_are_round(build):
    """URDF cylinders become prisms unless URDF_USE_IMPLICIT_CYLINDER is set: a ray sees the facets."""
    from anysim.model.world import Cylinder

    engine = build(worlds.resting(Cylinder(0.5, 0.1), 0.1))
    angle = np.linspace(0, 0.3, 40)
    along = -np.stack([np.cos(angle), np.sin(angle), np.zeros(40)], axis=-1)
    start = -2.0 * along + np.array([0.0, 0.0, 0.1])
    distance = engine.raycast(start[None], along[None]).distance[0]
    assert np.allclose(distance, 1.5, atol=1e-3)


def test_links_of_one_robot_collide(build):
    """Links do not collide with each other unless asked; parents and children never do, excluded pairs neither."""

    def chain(excluded=()):
        s = Sketch("chain", gravity=(0.0, 0.0, 0.0))
        base = s.robot("r")
        from anysim.model.world import JointType
        from anysim.testing.sketch import inertial

        ball = inertial(Sphere(0.1), 1.0)
        a = s.link("a", base, JointType.PRISMATIC, (1.0, 0.0, 0.0), ball)
        b = s.link("b", base, JointType.PRISMATIC, (1.0, 0.0, 0.0), ball, initial=0.5)
        s.shape(a, Sphere(0.1))
        s.shape(b, Sphere(0.1))
        return replace(s.world(), excluded_pairs=frozenset(excluded))

    for world, touch in ((chain(), True), (chain([(1, 2)]), False)):
        engine = build(world)
        engine.set_joint_state(velocity=[2.0, 0.0])
        engine.step(250)
        assert (engine.get_state().joint_vel[0, 1] > 0.5) == touch


def test_states_with_several_shapes_continue_exactly(build, own):
    """Several shapes on one link: a saved state continues differently. Here each further shape has a link."""
    engine = build(own.compounds())
    engine.step(200)
    snapshot = engine.snapshot()
    engine.step(300)
    wanted = read(engine)
    other = build(own.compounds())
    for again in (engine, engine, other):
        again.restore(snapshot)
        again.step(300)
        assert_same(read(again), wanted, "300 steps from the snapshot")
    assert len(engine.contacts().env) > 4


def test_a_robot_with_boxes_continues_exactly(build):
    """The same with drives, a mimic joint and contacts of a robot's own links."""
    from anysim.api import compile_world
    from anysim_bench.step import panda_and_boxes

    world = compile_world(panda_and_boxes())
    engine, other = build(world), build(world)
    spread(engine)
    play(engine, tape(world, [0], 40))
    snapshot, targets = engine.snapshot(), tape(world, [0], 60, seed=3)
    play(engine, targets)
    other.step(33)
    other.restore(snapshot)
    play(other, targets)
    assert_same(read(other), read(engine), "in another engine")


@pytest.mark.parametrize("short", [0.0, 1e-13, 5e-12, 1e-10, 1e-9, 3e-8, 1e-6])
def test_frames_that_are_almost_upright_are_met(short):
    """Roll and yaw are ill-conditioned beside a pitch of a right angle; rounding errors turned Tiago's fingers."""
    pitch = np.array([0.0, np.sin(np.pi / 4 - short), 0.0, np.cos(np.pi / 4 - short)])
    turn = P.from_roll_pitch_yaw(np.array([0.0, 0.0, 1.1]))
    wanted = P.normalize(P.multiply(P.multiply(turn, pitch), P.from_roll_pitch_yaw(np.array([0.7, 0.0, 0.0]))))
    again = P.from_roll_pitch_yaw(np.array(roll_pitch_yaw(wanted)))
    assert P.angle_between(wanted, again) < 3e-8

"""PhysX' hidden defaults are off: damping, joint friction, highest speeds, sleep, wrapped angles, gravity, sharing."""

import gc
from dataclasses import replace

import numpy as np
import pytest

from anysim.errors import EngineError
from anysim.model.world import Box, Geom, HeightField, HeightFieldShape, Inertial, JointType, Mimic, Physics, Sphere
from anysim.testing import worlds
from anysim.testing.sketch import Sketch, inertial

REVOLUTE, PRISMATIC = JointType.REVOLUTE, JointType.PRISMATIC
Z = (0.0, 0.0, 1.0)


def spinner(**joint):
    """One link that turns about z, without gravity."""
    s = Sketch("spinner", gravity=(0.0, 0.0, 0.0))
    base = s.robot("spinner")
    s.link("rotor", base, REVOLUTE, Z, inertial(Box((0.1, 0.1, 0.1)), 1.0), **joint)
    return s.world()


def test_every_default_that_acts_on_bodies_and_joints_is_set(make):
    """A value that PhysX would choose itself shows up here with its own default."""
    engine = make(worlds.scene())
    scene = engine._envs.scenes[0]
    for body, component in zip(engine.world.bodies, scene.bodies, strict=True):
        if body.kind == "static" and body.name != "arm.base":
            continue
        assert component.linear_damping == 0.0, body.name
        assert component.angular_damping == 0.0, body.name
        assert component.max_linear_velocity >= 1e8, body.name
        assert component.max_angular_velocity >= 1e8, body.name
        assert component.max_depenetration_velocity == engine.options.depenetration_velocity, body.name
    for joint in scene.joints:
        assert joint.friction == 0.0
        assert joint.max_velocity >= 1e8
        assert joint.stiffness == 0.0
        assert joint.force_limit > 1e38
    things = [tree.handle for tree in scene.trees] + [scene.bodies[engine.index.body("box")]]
    for thing in things:
        assert thing.sleep_threshold == 0.0
        assert thing.solver_position_iterations == engine.options.position_iterations
        assert thing.solver_velocity_iterations == engine.options.velocity_iterations
    for shape in (shape for shapes in scene.shapes for shape in shapes):
        assert shape.contact_offset == pytest.approx(engine.options.contact_offset)
        assert shape.rest_offset == 0.0
    assert not scene.system.config.enable_tgs
    assert scene.system.config.bounce_threshold == pytest.approx(engine.options.bounce_threshold)


def test_a_fast_joint_keeps_its_speed_and_counts_its_turns(make):
    """150 rad/s is above PhysX' default limit of joints, and three turns are not half a turn."""
    engine = make(spinner())
    engine.set_joint_state(velocity=150.0)
    engine.step(500)
    state = engine.get_state()
    assert state.joint_vel[0, 0] == pytest.approx(150.0, rel=1e-3)
    assert state.joint_pos[0, 0] == pytest.approx(150.0, rel=1e-3)


def test_a_fast_body_keeps_its_spin(make):
    """100 rad/s is above PhysX' default limit of links and bodies."""
    engine = make(worlds.spinning_ball())
    engine.set_body_state(twist=[0.0, 0.0, 0.0, 0.0, 0.0, 100.0])
    engine.step(100)
    assert engine.get_state().body_twist[0, 0, 5] == pytest.approx(100.0, rel=1e-4)


def test_gravity_is_that_of_its_own_scene(make):
    """Gravity is read when a scene is made; engines made in between do not change it, nor does a rebuild."""
    engines = [make(replace(worlds.falling_ball(), physics=Physics(gravity=(0.0, 0.0, -g)))) for g in (3.0, 9.0)]
    engines[0].reset()
    for engine in engines:
        engine.step(100)
    speeds = [engine.get_state().body_twist[0, 0, 2] for engine in engines]
    assert speeds == pytest.approx([-0.6, -1.8], rel=1e-4)
    engines[0].set_parameters("world.gravity", [[[0.0, 0.0, 5.0]]])
    engines[0].step(100)
    assert engines[0].get_state().body_twist[0, 0, 2] == pytest.approx(0.4, rel=1e-3)


def test_scenes_live_as_long_as_the_engine(make):
    """An articulation without its scene raises on every access."""
    engine = make(worlds.scene(), 3)
    gc.collect()
    engine.step(3)
    engine.reset([1])
    gc.collect()
    engine.step(3)
    assert np.isfinite(engine.get_state().joint_pos).all()


def test_joints_are_found_by_name(make):
    """PhysX sorts degrees of freedom breadth first; the World goes depth first."""
    engine = make(worlds.tree())
    order = engine._envs.scenes[0].trees[0].joints.tolist()
    assert order != sorted(order), "this world does not show the difference"
    engine.set_joint_state([[0.1, 0.2, 0.3, 0.4]])
    assert engine.get_state().joint_pos[0] == pytest.approx([0.1, 0.2, 0.3, 0.4])


def test_no_material_is_shared(make):
    """SAPIEN's default material is one object for all bodies: none of ours is that, nor each other's."""
    from anysim_sapien.library import physx

    before = physx.get_default_material().static_friction
    engine = make(worlds.scene(), 2)
    engine.set_parameters("geom.friction", 0.123)
    materials = [shape.physical_material for s in engine._envs.scenes for shapes in s.shapes for shape in shapes]
    assert physx.get_default_material().static_friction == before
    assert len({id(material) for material in materials}) == len(materials)


@pytest.mark.parametrize("inertia", [(0.02, 0.025, 0.03, 0.001, -0.002, 0.003), (0.02, 0.02, 0.02, 0.0, 0.0, 0.0)])
def test_inertia_keeps_its_products(make, inertia):
    """PhysX wants principal moments and their frame; the tensor comes back whole."""
    s = Sketch("turned")
    s.free("body", Sphere(0.1), (0.0, 0.0, 1.0), inertia=Inertial(1.0, (0.1, 0.0, 0.02), inertia))
    engine = make(s.world())
    assert engine.get_parameters("body.inertia")[0, 0] == pytest.approx(inertia, abs=1e-8)


def test_an_inertia_of_no_body_is_refused(make):
    """PhysX would take it and spin in its own way."""
    engine = make(worlds.spinning_ball())
    before = engine.get_parameters("body.inertia")
    with pytest.raises(EngineError, match="belongs to no rigid body"):
        engine.set_parameters("body.inertia", [[[0.1, 0.01, 0.01, 0.0, 0.0, 0.0]]])
    assert np.array_equal(engine.get_parameters("body.inertia"), before)


def test_no_mesh_that_is_not_convex_moves(make):
    """PhysX on the CPU would cook a field for seconds and then let it fall through the floor."""
    s = Sketch("flying_terrain")
    body = s.free("carpet", Sphere(0.1), (0.0, 0.0, 1.0), collides=False)
    s.more["heightfields"] = (HeightField("field", np.zeros((3, 3)), (1.0, 1.0)),)
    s.geoms.append(Geom("carpet.field", body, HeightFieldShape("field")))
    with pytest.raises(EngineError, match="HeightFieldShape on a body that moves"):
        make(s.world())


def test_a_mimic_joint_far_from_its_leader_is_refused(make):
    """A tendon joins neighbours; the joints are named before anything is built."""
    s = Sketch("far", gravity=(0.0, 0.0, 0.0))
    part = inertial(Box((0.1, 0.1, 0.1)), 1.0)
    first = s.link("first", s.robot("far"), REVOLUTE, Z, part)
    second = s.link("second", first, REVOLUTE, Z, part)
    s.link("third", second, REVOLUTE, Z, part, mimic=Mimic(0))
    with pytest.raises(EngineError, match=r"'far\.third' follow 'far\.first'"):
        make(s.world())


def test_a_mimic_joint_follows_its_parent_link(make):
    """The other shape of tendon: a link that follows the one it sits on."""
    s = Sketch("near", gravity=(0.0, 0.0, 0.0))
    part = inertial(Box((0.1, 0.1, 0.1)), 1.0)
    first = s.link("first", s.robot("near"), REVOLUTE, Z, part)
    s.link("second", first, REVOLUTE, Z, part, mimic=Mimic(0, -2.0, 0.1), initial=0.1)
    s.drive(first, kp=100.0, kd=20.0)
    engine = make(s.world())
    engine.set_control(position=0.4)
    for _ in range(20):
        engine.step(50)
        lead, follow = engine.get_state().joint_pos[0]
        assert follow == pytest.approx(-2.0 * lead + 0.1, abs=1e-3)
    assert lead == pytest.approx(0.4, abs=1e-3)

"""The state that SAPIEN packs, against its getters; and what is read late of a step, against the same read at once."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from anysim.compile.world import compile_world
from anysim.errors import EngineError
from anysim.math import pose as P
from anysim.model.world import Actuation, Box, JointType, Sphere, Surface
from anysim.testing import worlds
from anysim.testing.compare import assert_same, play, read, spread, tape
from anysim.testing.sketch import Sketch, inertial
from anysim.testing.varying import having, varied, with_slots
from anysim_sapien.declared import CAPABILITIES
from anysim_schemas.run import WorldSpec


def _several():
    """Two arms, a cabinet whose drawers have dry friction, and two boxes, listed between each other."""
    spec = {
        "robots": {"left": {"robot": "franka_panda"}, "right": {"robot": "franka_panda", "position": [1.2, 0.0, 0.0]}},
        "objects": {
            "box": {"source": {"box": [0.06, 0.06, 0.06]}},
            "cabinet": {"source": "procedural:cabinet", "fixed": True, "joints": {"*": {"friction": 0.5}}},
            "other": {"source": {"box": [0.06, 0.08, 0.06]}},
        },
        "layout": {
            "box": {"on": "terrain", "x": 0.45, "y": 0.3},
            "cabinet": {"on": "terrain", "x": 0.0, "y": 1.5},
            "other": {"on": "terrain", "x": 0.45, "y": -0.3},
        },
    }
    return compile_world(WorldSpec.model_validate(spec))


def _agrees(engine, env):
    """Poses, joints and velocities of an env, as its scene packs them, are those of the getters, and none is 0."""
    scene = engine._envs.scenes[env]
    scene.packing.check(scene)
    assert all(scene.velocities()[scene.layout.free].any(axis=1))
    assert all(scene.joint_velocities()[scene.layout.joint_there])
    state, there = engine.get_state(), scene.layout.there
    assert np.array_equal(state.body_pose[env][there], scene.poses()[there])
    for name, getter in (("joint_pos", "get_qpos"), ("joint_vel", "get_qvel")):
        for tree in scene.trees:
            assert np.array_equal(getattr(state, name)[env, tree.joints], getattr(tree.handle, getter)()), name


@pytest.mark.parametrize("world", [worlds.scene, worlds.gripper, worlds.tree, worlds.loose, _several])
def test_packed_numbers_are_the_getters(make, world):
    """Articulations of several sizes, mimic joints, degrees of freedom in PhysX' own order, single bodies."""
    engine = make(world(), 2)
    spread(engine)
    engine.step(7)
    for env in range(2):
        _agrees(engine, env)


def test_packed_numbers_of_what_is_there(make):
    """Envs in which different things are there have them in different places."""
    world = varied(CAPABILITIES)
    engine = make(world, 3)
    engine.reset([1], present=having(world, "mug~2", "chest~0"))
    engine.reset([2], present=having(world, "lid"))
    free = [i for i, b in enumerate(world.bodies) if b.kind == "free"]
    for _ in range(2):
        engine.set_body_state(twist=[0.1, 0.2, 0.3, 0.4, 0.5, 0.6], bodies=free)
        engine.set_joint_state(velocity=0.1)
        engine.step(2)
        sizes = {scene.packing.size for scene in engine._envs.scenes}
        assert len(sizes) == 3, "the envs do not differ"
        for env in range(3):
            _agrees(engine, env)
        engine.reset([0], present=having(world, "mug~2", "lid"))


def test_another_order_is_refused(make, monkeypatch):
    """A SAPIEN that packs something else is not read wrong in silence."""
    monkeypatch.setattr("anysim_sapien.packing._PER_JOINT", 5)
    with pytest.raises(EngineError, match="packs the state of a scene in another order"):
        make(worlds.scene())


def test_links_move_in_an_env_beside_one_without_them(make):
    """Twists of links do not depend on what is there in the first env."""
    s = Sketch("slotted")
    s.fixed("post", Box((0.1, 0.1, 0.1)), (1.0, 0.0, 0.0))
    part = inertial(Sphere(0.05), 1.0)
    arm = s.link("arm", s.robot("swing"), JointType.REVOLUTE, (0.0, 0.0, 1.0), part, position=(0.3, 0.0, 0.0))
    world = with_slots(s.world(), {"swing": ("swing",)})
    engine = make(world, 2)
    engine.reset([0], present=having(world))
    engine.set_joint_state(velocity=0.5)
    assert engine.get_state().body_twist[1, arm, 5] == pytest.approx(0.5)
    assert not engine.get_state().body_twist[0, arm].any()


def test_what_takes_another_things_place_is_read_as_itself(make):
    """Two boxes that lie alike are the same numbers in SAPIEN, of another body."""
    s = Sketch("alike")
    first, second = (s.free(name, Box((0.1, 0.1, 0.1)), (0.3, 0.0, 0.5), 1.0) for name in ("first", "second"))
    world = with_slots(s.world(), {"box": ("first", "second")})
    engine = make(world, 2)
    for name, body in (("first", first), ("second", second)):
        engine.reset(present=np.repeat(having(world, name), 2, axis=0))
        assert engine.get_state().body_pose[:, body, 0] == pytest.approx(0.3)


@pytest.mark.parametrize("actuation", list(Actuation))
def test_efforts_may_be_asked_for_late(make, actuation):
    """After commands, gains, writes, renewals and steps of other envs they are those of an env's own last step."""
    world = worlds.scene(sensor=True)
    world = replace(world, physics=replace(world.physics, actuation=actuation))
    late, prompt = (make(world, 2, rebase_steps=20) for _ in range(2))

    def asked(action, env_ids=None):
        wanted = prompt.get_state().joint_effort.copy()
        assert wanted.any()
        for engine in (late, prompt):
            action(engine)
        assert np.array_equal(late.get_state().joint_effort, wanted)
        for engine in (late, prompt):
            engine.step(2, env_ids)

    for engine in (late, prompt):
        spread(engine)
        play(engine, tape(world, [0, 1], 5))
    asked(lambda e: e.set_control(position=0.3))
    asked(lambda e: e.set_parameters("actuator.kp", 20.0))
    asked(lambda e: e.set_joint_state(velocity=1.0))
    asked(lambda e: e.set_parameters("geom.friction", 0.4))
    for engine in (late, prompt):
        engine.step(1)
    wanted = prompt.get_state().joint_effort[1]
    for engine in (late, prompt):
        engine.set_control(position=-0.2)
        engine.step(21, [0])
    assert np.array_equal(late.get_state().joint_effort[1], wanted), "steps of another env"
    assert_same(read(late), read(prompt), "in the end")


def _pressed():
    """A foot on rails that is pressed on the ground and slides, and a ball."""
    s = Sketch("pressed")
    s.ground(Surface(friction=0.5))
    part = inertial(Box((0.05, 0.05, 0.05)), 0.5)
    rail = s.link("rail", s.robot("leg", (0.0, 0.0, 0.1)), JointType.PRISMATIC, (1.0, 0.0, 0.0), part)
    foot = s.link("foot", rail, JointType.PRISMATIC, (0.0, 0.0, 1.0), part)
    s.shape(foot, Box((0.05, 0.05, 0.05)), surface=Surface(friction=0.5))
    s.drive(rail, kp=200.0, kd=5.0)
    s.drive(foot, kp=2000.0, kd=100.0)
    s.free("ball", Sphere(0.05), (0.5, 0.0, 0.05), 1.0)
    return s.world()


@pytest.mark.parametrize("world", [worlds.scene, _pressed])
def test_contacts_may_be_asked_for_late(make, world):
    """Masses, dry friction, damping and motions that are written after a step do not change what it did."""
    world = world()
    free = [i for i, b in enumerate(world.bodies) if b.kind == "free"]
    links = [i for i, b in enumerate(world.bodies) if b.kind == "link"]
    writes = (
        lambda e: e.set_parameters("body.mass", 1.5 * e.get_parameters("body.mass")),
        lambda e: e.set_parameters("body.com", e.get_parameters("body.com", indices=links) + 0.02, indices=links),
        lambda e: e.set_parameters("joint.friction", 0.2),
        lambda e: e.set_parameters("body.linear_damping", 0.5, indices=free),
        lambda e: e.set_joint_state(velocity=2.0),
        lambda e: e.set_body_state(twist=[1.0, 0.0, 0.0, 0.0, 0.0, 1.0], bodies=free),
    )
    late, prompt = (make(world) for _ in range(2))
    for engine in (late, prompt):
        spread(engine)
        engine.set_control(position=[[0.1, -0.1]])
        engine.step(150)
    for write in writes:
        wanted = prompt.contacts()
        assert wanted.force.any()
        for engine in (late, prompt):
            write(engine)
        assert all(np.array_equal(a, b) for a, b in zip(late.contacts(), wanted, strict=True))
        for engine in (late, prompt):
            engine.step(3)
    assert_same(read(late), read(prompt), "in the end")


def test_twists_follow_a_centre_of_mass_that_moves(make):
    """A body's velocity is that of its origin, whose arm to the centre of mass is the present one."""
    engine = make(worlds.loose())
    free = [i for i, b in enumerate(engine.world.bodies) if b.kind == "free"]
    engine.set_body_state(twist=[0.0, 0.0, 0.0, 0.0, 0.0, 1.0], bodies=free)
    for _ in range(2):
        engine.set_parameters("body.com", engine.get_parameters("body.com", indices=free) + 0.03, indices=free)
        state, scene = engine.get_state(), engine._envs.scenes[0]
        for body in free:
            arm = P.rotate(state.body_pose[0, body, 3:], engine.get_parameters("body.com")[0, body])
            wanted = scene.bodies[body].linear_velocity - P.cross(
                scene.bodies[body].angular_velocity.astype(float), arm
            )
            assert state.body_twist[0, body, :3] == pytest.approx(wanted, abs=1e-12)


def test_naming_the_engine_loads_no_compiler():
    """Numba is loaded where a world is built."""
    code = (
        "import sys; from anysim import registry; registry.load('engines', 'sapien'); assert 'numba' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)

"""Parameters per env: what is written is what the physics has, and nothing else changes."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.conventions import xyzw_from_wxyz
from anysim.errors import EngineError
from anysim.model.world import Body, BodyKind, Geom, Inertial, Sphere, World
from anysim_mujoco.inertia import full, principal


def test_principal_axes_and_back():
    """Full tensors survive, diagonal ones keep their axes, equal tensors give equal bits."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        tensor = axes @ np.diag(rng.uniform(0.5, 1.0, 3)) @ axes.T
        packed = np.array([tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))])
        moments, frame = principal(packed)
        assert np.allclose(full(moments, frame), packed, atol=1e-14)
        again = principal(packed)
        assert np.array_equal(moments, again[0])
        assert np.array_equal(frame, again[1])
    moments, frame = principal(np.array([3.0, 1.0, 2.0, 0.0, 0.0, 0.0]))
    assert moments.tolist() == [3.0, 1.0, 2.0]
    assert frame.tolist() == [1.0, 0.0, 0.0, 0.0]


def test_same_values_give_the_same_bits(worlds, make, shake):
    """Writing what is there already changes no trajectory, although every field becomes the env's own."""
    plain, written = make(worlds.scene(), 2), make(worlds.scene(), 2)
    for name in sorted(written.parameters - {"actuator.effort_limit", "body.inertia"}):
        written.set_parameters(name, written.get_parameters(name))
    assert all(np.array_equal(a, b) for a, b in zip(shake(plain), shake(written), strict=True))


@pytest.mark.parametrize(
    "name",
    [
        "body.mass",
        "body.com",
        "body.inertia",
        "joint.damping",
        "joint.friction",
        "joint.armature",
        "actuator.kp",
        "actuator.kd",
        "world.gravity",
        "geom.friction",
    ],
)
def test_a_changed_env_moves_like_a_world_with_that_value(worlds, make, shake, name):
    """Against a model compiled with the value, and the other env against the one without."""
    world = worlds.scene()
    changed = {
        "body.mass": lambda w: _bodies(w, mass=1.7),
        "body.com": lambda w: _bodies(w, com=(0.03, 0.02, -0.01)),
        "body.inertia": lambda w: _bodies(w, inertia=(0.011, 0.012, 0.013, 0.001, -0.002, 0.0005)),
        "joint.damping": lambda w: replace(w, joints=tuple(replace(j, damping=0.5) for j in w.joints)),
        "joint.friction": lambda w: replace(w, joints=tuple(replace(j, friction=0.3) for j in w.joints)),
        "joint.armature": lambda w: replace(w, joints=tuple(replace(j, armature=0.05) for j in w.joints)),
        "actuator.kp": lambda w: replace(w, actuators=tuple(replace(a, kp=70.0) for a in w.actuators)),
        "actuator.kd": lambda w: replace(w, actuators=tuple(replace(a, kd=7.0) for a in w.actuators)),
        "world.gravity": lambda w: replace(w, physics=replace(w.physics, gravity=(1.0, 0.0, -3.0))),
        "geom.friction": lambda w: replace(
            w, geoms=tuple(replace(g, surface=replace(g.surface, friction=0.1)) for g in w.geoms)
        ),
    }[name](world)
    engine, compiled, plain = make(world, 2), make(changed), make(world)
    engine.set_parameters(name, compiled.get_parameters(name), [1])
    assert np.allclose(engine.get_parameters(name)[1], compiled.get_parameters(name)[0], atol=1e-15)
    for e in (engine, compiled, plain):
        e.set_body_state(twist=np.tile([0.5, 0.2, 0.0, 1.0, 2.0, 0.5], (e.num_envs, 2, 1)))
    for ours, with_it, without in zip(shake(engine, 10), shake(compiled, 10), shake(plain, 10), strict=True):
        assert np.array_equal(ours[0], without[0])
        assert np.allclose(ours[1], with_it[0], atol=1e-9)
    assert not np.allclose(ours[1], without[0], atol=1e-6)


def _bodies(world, **changes):
    # the lower link: its geom sits elsewhere than its centre of mass, and must stay there
    return replace(
        world,
        bodies=(*world.bodies[:4], replace(world.bodies[4], inertial=world.bodies[4].inertial._replace(**changes))),
    )


def test_geoms_stay_when_the_centre_of_mass_moves(make):
    """Also a geom in the very frame of the inertia, which MuJoCo's compiler takes for one with it."""
    tensor = (0.011, 0.012, 0.013, 0.001, -0.002, 0.0005)
    _, frame = principal(np.array(tensor))
    x, y, z, w = (float(v) for v in xyzw_from_wxyz(frame))
    body = Body("b", BodyKind.FREE, inertial=Inertial(1.0, (0.0, 0.0, 0.1), tensor))
    for quaternion in ((0.0, 0.0, 0.0, 1.0), (x, y, z, w)):
        engine = make(World(bodies=(body,), geoms=(Geom("g", 0, Sphere(0.05), (0.0, 0.0, 0.1), quaternion),)))
        engine.set_parameters("body.com", [[[0.0, 0.2, 0.0]]])
        hit = engine.raycast([[[0.0, 0.0, 1.0], [0.0, 0.2, 1.0]]], [[[0.0, 0.0, -1.0]] * 2])
        assert hit.distance[0, 0] == pytest.approx(0.85)
        assert np.isinf(hit.distance[0, 1])


def test_an_inertia_may_turn_away_from_its_bodys_axes(worlds, make, shake):
    """Of a body whose own was diagonal, against a model compiled with the new one."""
    world, tensor = worlds.scene(), (0.011, 0.02, 0.021, 0.004, -0.002, 0.003)
    upper = replace(world.bodies[3], inertial=world.bodies[3].inertial._replace(inertia=tensor))
    compiled = make(replace(world, bodies=(*world.bodies[:3], upper, world.bodies[4])))
    engine = make(world)
    engine.set_parameters("body.inertia", [[tensor]], indices=[3])
    for ours, wanted in zip(shake(engine, 10), shake(compiled, 10), strict=True):
        assert np.allclose(ours, wanted, atol=1e-9)


def test_parameters_survive_resets_and_belong_to_their_env(worlds, make):
    """A reset is of the state alone."""
    engine = make(worlds.scene(), 3)
    engine.set_parameters("body.mass", [[2.5]], [1], [1])
    engine.reset()
    assert engine.get_parameters("body.mass", indices=[1])[:, 0].tolist() == [1.0, 2.5, 1.0]


def test_an_impossible_inertia_is_refused(worlds, make):
    """Before anything is written."""
    engine = make(worlds.scene())
    before = engine.get_parameters("body.inertia")
    with pytest.raises(EngineError, match=r"inertia of body 'box' belongs to no rigid body"):
        engine.set_parameters("body.inertia", [[[1.0, 0.1, 0.1, 0.0, 0.0, 0.0]]], indices=[1])
    assert np.array_equal(engine.get_parameters("body.inertia"), before)


def test_weight_follows_mass_and_gravity(worlds, make):
    """Contact force at rest, per env."""
    engine = make(worlds.ball(0.05), 3)
    engine.set_parameters("body.mass", [[0.8]], [1])
    engine.set_parameters("world.gravity", [[[0.0, 0.0, -3.0]]], [2])
    engine.step(1500)
    assert np.allclose(engine.get_state().contact_force[:, 0, 2], [0.5 * 9.81, 0.8 * 9.81, 0.5 * 3.0], rtol=1e-6)

"""Physical and visual properties: damping, bounce, centre of mass, looks. Answers known by hand, per env."""

from dataclasses import replace
from math import exp

import numpy as np
import pytest

from anysim.engine.capability import Capability as C
from anysim.errors import EngineError
from anysim.model.world import Box, Camera, ContactSensor, Solver, Sphere, Surface
from anysim.testing import looks, tolerances, worlds
from anysim.testing.compare import assert_close, assert_ratio, assert_same, read
from anysim.testing.fixtures import needs, skip_without_parameter
from anysim.testing.sketch import Sketch

RATES = np.array([0.0, 0.5, 2.0, 400.0])
"""[1/s]; with the last one all speed is gone within a few steps, and none must come back."""


CUBE = Box((0.3, 0.3, 0.3))


def _with_body(world, **fields):
    return replace(world, bodies=(replace(world.bodies[0], **fields), *world.bodies[1:]))


@needs(C.DYNAMICS, C.BODY_DAMPING)
@pytest.mark.parametrize("com", [(0.0, 0.0, 0.0), (0.05, -0.02, 0.03)])
def test_linear_damping_is_exponential(build, engine_class, com):
    """A coasting body slows as v0 exp(-c t), wherever its centre of mass is, and does not begin to turn."""
    skip_without_parameter(engine_class, "body.linear_damping")
    engine = build(worlds.drifting(com=com), len(RATES))
    engine.set_parameters("body.linear_damping", RATES[:, None])
    engine.set_body_state(twist=[1.0, -0.5, 0.25, 0.0, 0.0, 0.0])
    engine.step(500)
    twist = engine.get_state().body_twist[:, 0]
    wanted = np.exp(-RATES)[:, None] * [1.0, -0.5, 0.25]
    assert_close(twist[:, :3], wanted, tolerances.COASTING, "velocities after 1 s")
    assert np.abs(twist[:, 3:]).max() < tolerances.COASTING


@needs(C.DYNAMICS, C.BODY_DAMPING)
@pytest.mark.parametrize("axis", range(3))
def test_angular_damping_is_exponential(build, engine_class, axis):
    """A spin about a principal axis slows as w0 exp(-c t), whatever the inertia about it; the rest stays at rest."""
    skip_without_parameter(engine_class, "body.angular_damping")
    engine = build(worlds.spinning_ball(), len(RATES))
    engine.set_parameters("body.angular_damping", RATES[:, None])
    spin = np.zeros(6)
    spin[3 + axis] = 2.0
    engine.set_body_state(twist=spin)
    engine.step(500)
    twist = engine.get_state().body_twist[:, 0]
    assert_close(twist[:, 3 + axis], 2.0 * np.exp(-RATES), 2 * tolerances.COASTING, "rates after 1 s")
    assert np.abs(np.delete(twist, 3 + axis, axis=1)).max() < tolerances.COASTING


@needs(C.DYNAMICS, C.BODY_DAMPING)
def test_a_damped_fall_reaches_its_final_speed(build, engine_class):
    """With gravity g and a rate c a body falls at g / c (1 - exp(-c t))."""
    skip_without_parameter(engine_class, "body.linear_damping")
    engine = build(_with_body(worlds.falling_ball(), damping=(2.0, 0.0)), 2)
    engine.set_parameters("body.linear_damping", [[5.0]], env_ids=[1])
    engine.step(500)
    speed = -engine.get_state().body_twist[:, 0, 2]
    # gravity acts before or after the damping of a step: c dt of the speed either way
    for found, rate in zip(speed, (2.0, 5.0), strict=True):
        assert_ratio(found, 9.81 / rate * (1 - exp(-rate)), 1.1 * rate * 0.002, f"speed after 1 s at a rate of {rate}")


@needs(C.DYNAMICS, C.BODY_DAMPING, C.CONTACT_SENSORS)
def test_damping_is_no_contact(build, engine_class):
    """Contact sensors do not take what damps a body for something that touches it."""
    sketch = Sketch("damped", gravity=(0.0, 0.0, -9.81))
    body = sketch.free("ball", Sphere(0.1), (0.0, 0.0, 5.0), mass=2.0)
    sketch.sensors.append(ContactSensor("ball", (body,)))
    engine = build(_with_body(sketch.world(), damping=(3.0, 1.0)), 1)
    engine.set_body_state(twist=[1.0, 2.0, 0.0, 3.0, 0.0, 0.0])
    if C.WRENCHES in engine_class.capabilities:
        engine.apply_wrench([5.0, 0.0, 0.0, 0.0, 0.0, 0.0], [body])
    engine.step(50)
    # single-precision speeds of about 2 m/s, differenced over 2 ms, on 2 kg
    assert np.abs(engine.get_state().contact_force).max() < 1e-3


@needs(C.BODY_DAMPING)
def test_damping_is_for_loose_bodies(build, engine_class):
    """A rate for a link or a fixed body is refused by name; 0 is what they have."""
    skip_without_parameter(engine_class, "body.linear_damping")
    engine = build(worlds.scene())
    link = next(i for i, b in enumerate(engine.world.bodies) if b.kind == "link")
    engine.set_parameters("body.linear_damping", [[0.0]], indices=[link])
    with pytest.raises(EngineError, match=f"free bodies without links, and '{engine.world.bodies[link].name}'"):
        engine.set_parameters("body.linear_damping", [[1.0]], indices=[link])


@needs(C.DYNAMICS)
def test_bounce_height_per_env(build, engine_class):
    """A ball dropped from h comes up to e^2 h, with the coefficient of its env; set back to 0 it does not bounce."""
    skip_without_parameter(engine_class, "geom.restitution")
    height, radius = 0.5, 0.1
    engine = build(worlds.bouncing_ball(0.5, height=height), 3)
    ball = next(i for i, g in enumerate(engine.world.geoms) if g.body == 0)
    engine.set_parameters("geom.restitution", [[0.8], [0.6], [0.0]], indices=[ball])
    exact = engine.capabilities.supported[C.RESTITUTION].exact
    top, hit = np.zeros(3), np.zeros(3, dtype=bool)
    for _ in range(900):
        engine.step()
        state = engine.get_state()
        hit |= state.body_pose[:, 0, 2] < radius + 0.01
        rising = hit & (state.body_twist[:, 0, 2] >= 0)
        top = np.where(rising, np.maximum(top, state.body_pose[:, 0, 2] - radius), top)
    drop = engine.world.bodies[0].position[2] - radius
    for env, e in enumerate((0.8, 0.6)):
        assert_ratio(top[env], e**2 * drop, 0.06 if exact else tolerances.BOUNCE["approximate"], f"height at {e}")
    assert top[2] < 0.04 * drop


@needs(C.DYNAMICS)
def test_a_shifted_centre_of_mass_tips_a_box(build, engine_class):
    """A box whose centre of mass is not above its foot tips over; one whose centre is stands."""
    skip_without_parameter(engine_class, "body.com")
    engine = build(worlds.resting(Box((0.1, 0.1, 0.1)), 0.1), 2)
    engine.set_parameters("body.com", [[[0.08, 0.0, 0.0]], [[0.13, 0.0, 0.0]]])
    engine.step(400)
    up = engine.get_state().body_pose[:, 0]
    tilt = np.abs(up[:, 4])
    assert tilt[0] < 0.01
    assert tilt[1] > 0.2


@needs(C.DYNAMICS)
def test_a_centre_of_mass_moves_under_way(build, engine_class):
    """Moving a centre of mass leaves poses, joints and the frame's velocity as they are; back again is as built."""
    skip_without_parameter(engine_class, "body.com")
    engine, clean = (build(worlds.scene(), 1) for _ in range(2))
    free = int(np.flatnonzero(engine.world.loose)[0])
    engine.step(20)
    before = engine.get_state()
    pose, joints = before.body_pose, before.joint_pos
    built = engine.get_parameters("body.com")
    engine.set_parameters("body.com", [[[0.01, 0.0, 0.02]]], indices=[free])
    after = engine.get_state()
    assert_close(after.body_pose, pose, tolerances.KINEMATICS, "poses")
    assert_close(after.joint_pos, joints, tolerances.READ_BACK, "joints")
    engine.step(20)
    engine.set_parameters("body.com", built)
    for e in (engine, clean):
        e.reset()
        e.step(50)
    assert_same(read(engine), read(clean), "the run with the centre of mass back in its place")


@needs(C.SNAPSHOT_TRAJECTORY)
def test_snapshots_continue_exactly_with_changed_matter(build, engine_class):
    """What was changed is part of a snapshot: continuing from it is the uninterrupted run, bit for bit."""
    names = {
        "body.com": [0.0, 0.01, 0.02],
        "body.linear_damping": 0.7,
        "body.angular_damping": 0.3,
        "geom.restitution": 0.5,
    }
    names = {name: value for name, value in names.items() if name in engine_class.parameters}
    engine, other = (build(worlds.bouncing_ball(0.2), 2) for _ in range(2))
    for name, value in names.items():
        engine.set_parameters(name, [[value]], env_ids=[1], indices=[0])
    engine.set_body_state(twist=[0.3, 0.0, 0.0, 0.0, 5.0, 0.0])
    engine.step(330)
    snapshot = engine.snapshot()
    engine.step(200)
    wanted = read(engine)
    for target in (engine, other):
        target.restore(snapshot)
        for name, value in names.items():
            assert np.allclose(target.get_parameters(name)[1, 0], value, rtol=tolerances.READ_BACK, atol=1e-9)
        target.step(200)
        assert_same(read(target), wanted, "a run from a snapshot")


@needs(C.DYNAMICS, C.SOLVER_SETTINGS)
def test_solver_settings_are_taken(build):
    """A body with settings of its own falls and rests as others do."""
    world = worlds.resting(Box((0.1, 0.1, 0.1)), 0.1)
    own = Solver(position_iterations=4, velocity_iterations=0, sleep_threshold=1e-4, depenetration_speed=1.0)
    engine = build(_with_body(world, solver=own))
    engine.step(300)
    assert abs(engine.get_state().body_pose[0, 0, 2] - 0.1) < tolerances.REST_HEIGHT


@needs(C.DYNAMICS)
def test_a_contact_offset_lifts_nothing(build):
    """Contacts are prepared from the offset on and act from touch on: a box rests on the ground."""
    surface = Surface(contact_offset=0.015)
    sketch = Sketch("offset")
    sketch.ground(surface)
    sketch.free("box", Box((0.1, 0.1, 0.1)), (0.0, 0.0, 0.12), surface=surface)
    engine = build(sketch.world())
    engine.step(500)
    assert abs(engine.get_state().body_pose[0, 0, 2] - 0.1) < tolerances.REST_HEIGHT


# ---------------------------------------------------------------------- how it looks


def _painted(texture="", color=(1.0, 1.0, 1.0, 1.0), material="", shape=CUBE):
    """A thing that fills the middle of an image."""
    sketch = Sketch("painted", gravity=(0.0, 0.0, 0.0))
    sketch.fixed("thing", shape, (0.0, 0.0, 0.0), collides=False)
    sketch.cameras.append(Camera("front", -1, (0.0, -2.0, 0.0), (-(0.5**0.5), 0.0, 0.0, 0.5**0.5), 30.0, 48, 48))
    sketch.more = {"textures": looks.TEXTURES, "materials": looks.MATERIALS}
    world = sketch.world()
    return replace(world, geoms=(replace(world.geoms[0], texture=texture, color=color, material=material),))


def _hue(pixels):
    """Which of red, green and blue stands out, for an image (H, W, 3) of one colour."""
    mean = pixels.reshape(-1, 3).astype(float).mean(axis=0)
    order = np.sort(mean)
    return "grey" if order[2] - order[1] < 20 else "red green blue".split()[int(mean.argmax())]


@needs(C.RENDER_RGB, C.TEXTURES)
@pytest.mark.parametrize("shape", [CUBE, Sphere(0.3)], ids=["box", "sphere"])
def test_textures_per_env(build, engine_class, shape):
    """Each env shows its own texture: as built, another, none; and then they change again."""
    skip_without_parameter(engine_class, "geom.texture")
    engine = build(_painted("red", shape=shape), 3)
    engine.set_parameters("geom.texture", [[1.0]], env_ids=[1])
    engine.set_parameters("geom.texture", [[-1.0]], env_ids=[2])
    seen = [_hue(image[20:28, 20:28]) for image in engine.render("front")["rgb"]]
    assert seen == ["red", "green", "grey"]
    engine.set_parameters("geom.texture", [[-1.0], [0.0], [1.0]])
    seen = [_hue(image[20:28, 20:28]) for image in engine.render("front")["rgb"]]
    assert seen == ["grey", "red", "green"]


@needs(C.RENDER_RGB, C.TEXTURES)
def test_a_texture_comes_after_the_first_image(build, engine_class):
    """What was first seen without a texture can be given one."""
    skip_without_parameter(engine_class, "geom.texture")
    engine = build(_painted("red"), 1)
    seen = []
    for texture in (-1.0, 1.0, -1.0, 0.0):
        engine.set_parameters("geom.texture", [[texture]])
        seen.append(_hue(engine.render("front")["rgb"][0, 20:28, 20:28]))
    assert seen == ["grey", "green", "grey", "red"]


@needs(C.RENDER_RGB, C.TEXTURES)
def test_a_texture_stands_upright_on_a_side(build):
    """The top row of the image is on top."""
    image = build(_painted("halves")).render("front")["rgb"][0]
    assert _hue(image[16:22, 20:28]) == "red"
    assert _hue(image[26:32, 20:28]) == "blue"


@needs(C.RENDER_RGB, C.TEXTURES)
def test_a_texture_is_tinted(build, engine_class):
    """The colour multiplies the texture."""
    skip_without_parameter(engine_class, "geom.color")
    engine = build(_painted("halves"), 2)
    engine.set_parameters("geom.color", [[[0.0, 1.0, 1.0, 1.0]]], env_ids=[1])
    plain, tinted = engine.render("front")["rgb"][:, 16:22, 20:28].astype(int)
    assert plain[..., 0].min() > 40 + 2 * tinted[..., 0].max()


@needs(C.RENDER_RGB, C.MATERIALS)
def test_materials_per_env(build, engine_class):
    """A material is taken, kept per env and drawn; where the engine draws emission exactly, a lamp is brighter."""
    skip_without_parameter(engine_class, "geom.material")
    engine = build(_painted(color=(0.5, 0.5, 0.5, 1.0), material="dull"), 2)
    assert engine.get_parameters("geom.material").tolist() == [[1.0], [1.0]]
    engine.set_parameters("geom.material", [[0.0]], env_ids=[1])
    assert engine.get_parameters("geom.material").tolist() == [[1.0], [0.0]]
    dull, lamp = engine.render("front")["rgb"][:, 20:28, 20:28].astype(int)
    assert lamp.mean() > dull.mean() - 1
    if engine.capabilities.supported[C.MATERIALS].exact:
        assert lamp.mean() > dull.mean() + 20


@needs(C.RENDER_RGB)
def test_an_index_must_exist(build, engine_class):
    """A texture that the world does not have is refused with those it has."""
    skip_without_parameter(engine_class, "geom.texture")
    engine = build(_painted("red"))
    with pytest.raises(EngineError, match=r"textures: 0 red, 1 green, 2 halves"):
        engine.set_parameters("geom.texture", [[3.0]])
    with pytest.raises(EngineError, match=r"or -1, got 0\.5"):
        engine.set_parameters("geom.texture", [[0.5]])


@needs(C.RENDER_RGB, C.TEXTURES)
def test_the_ground_takes_a_texture(build, engine_class):
    """A plane shows its texture lying flat, per env."""
    skip_without_parameter(engine_class, "geom.texture")
    sketch = Sketch("ground")
    sketch.ground()
    sketch.cameras.append(Camera("above", -1, (0.0, 0.0, 3.0), (1.0, 0.0, 0.0, 0.0), 30.0, 48, 48))
    sketch.more = {"textures": looks.TEXTURES, "materials": looks.MATERIALS}
    engine = build(sketch.world(), 3)
    engine.set_parameters("geom.texture", [[0.0], [1.0]], env_ids=[0, 1])
    engine.set_parameters("geom.color", [[[1.0, 1.0, 1.0, 1.0]]] * 3)
    seen = [_hue(image[20:28, 20:28]) for image in engine.render("above")["rgb"]]
    assert seen == ["red", "green", "grey"]

"""Parameters per env: what is written is read back, and it matters to the motion."""

from dataclasses import replace
from math import exp

import numpy as np
import pytest

from anysim.engine.capability import Capability as C
from anysim.engine.parameters import PARAMETERS, count, nominal
from anysim.errors import CapabilityError, EngineError
from anysim.model.world import Box, ControlMode
from anysim.testing import looks, tolerances, worlds
from anysim.testing.compare import assert_close, assert_ratio, assert_same, play, read, tape
from anysim.testing.fixtures import needs, skip_without_parameter

NAMES = sorted(PARAMETERS)


def _scene():
    """A world with something of everything that has parameters."""
    return replace(worlds.lit(), textures=looks.TEXTURES, materials=looks.MATERIALS)


def _wanted(world, name):
    """The values (K, ...) that the World gives."""
    target, field = name.split(".")
    if target == "light":
        nowhere = (0.0, 0.0, 0.0)
        return np.array([getattr(light, field) or nowhere for light in world.lights], dtype=float)
    if target == "world" and field != "gravity":
        return np.array([getattr(world.scenery, field)], dtype=float)
    return nominal(name, world)


def _changed(name, values):
    """Other values that are as plausible: 30 % more, and something where there was nothing."""
    if PARAMETERS[name].index_of:
        return np.where(values > 0, 0.0, 1.0)
    nothing = 0.0 if name == "body.inertia" else 0.004  # off the diagonal even little can be too much
    return np.clip(values, -1e3, 1e3) * 1.3 + np.where(values == 0, nothing, 0.0)


def _movable(world, name):
    """The indices whose value an engine must be able to change: not those of bodies that cannot move."""
    if name == "light.position":
        return [i for i, light in enumerate(world.lights) if light.position is not None]
    if PARAMETERS[name].loose:
        return np.flatnonzero(world.loose).tolist()
    if not name.startswith("body."):
        return list(range(count(PARAMETERS[name], world)))
    return [i for i, b in enumerate(world.bodies) if b.kind != "static"]


@pytest.mark.parametrize("name", NAMES)
def test_parameters_begin_as_the_world_says(build, engine_class, name):
    """Right after the build every parameter has the World's value in every env."""
    skip_without_parameter(engine_class, name)
    world = _scene()
    engine = build(world, 2)
    which = _movable(world, name)
    wanted = _wanted(world, name)[which]
    for row in engine.get_parameters(name, indices=which):
        assert np.allclose(row, wanted, rtol=tolerances.READ_BACK, atol=1e-9), (
            f"{name}: {row} where the World has {wanted}"
        )


@pytest.mark.parametrize("name", NAMES)
def test_parameters_are_per_env(build, engine_class, name):
    """A value written for one env and index is read back there, and nowhere else."""
    skip_without_parameter(engine_class, name)
    world = _scene()
    engine = build(world, 3)
    before = engine.get_parameters(name)
    index = _movable(world, name)[-1]
    wanted = _changed(name, before[1, index])
    engine.set_parameters(name, wanted[None, None], env_ids=[1], indices=[index])
    after = engine.get_parameters(name)
    assert np.allclose(after[1, index], wanted, rtol=tolerances.READ_BACK)
    after[1, index] = before[1, index]
    assert np.array_equal(after, before), f"{name}: other envs or indices changed too"
    subset = engine.get_parameters(name, env_ids=[1], indices=[index])
    assert subset.shape == (1, 1, *PARAMETERS[name].shape)
    assert np.allclose(subset[0, 0], wanted, rtol=tolerances.READ_BACK)


@pytest.mark.parametrize("name", NAMES)
def test_parameters_survive_a_reset(build, engine_class, name):
    """`reset` leaves parameters as they are."""
    skip_without_parameter(engine_class, name)
    world = _scene()
    engine = build(world, 2)
    index = _movable(world, name)[0]
    engine.set_parameters(name, _changed(name, engine.get_parameters(name, [1], [index])), [1], [index])
    kept = engine.get_parameters(name)
    engine.step()
    engine.reset()
    assert np.array_equal(engine.get_parameters(name), kept)


@pytest.mark.parametrize("name", NAMES)
def test_one_envs_parameters_leave_the_others(build, engine_class, name):
    """Envs whose parameters were not touched run on, bit for bit."""
    skip_without_parameter(engine_class, name)
    world = _scene()
    engine, clean = build(world, 2), build(world, 2)
    which = _movable(world, name)
    engine.set_parameters(name, _changed(name, engine.get_parameters(name, [1], which)), [1], which)
    for e in (engine, clean):
        play(e, tape(world, [0, 1], 25))
    assert_same(read(engine, [0]), read(clean, [0]), f"the env beside a changed {name}")


def test_declared_parameters_are_served_and_no_others(build, engine_class):
    """What the engine does not declare in `parameters` raises CapabilityError on reading and writing."""
    engine = build(_scene())
    for name in NAMES:
        if name in engine_class.parameters:
            wanted = (1, count(PARAMETERS[name], engine.world), *PARAMETERS[name].shape)
            assert engine.get_parameters(name).shape == wanted
            continue
        with pytest.raises(CapabilityError, match=name):
            engine.get_parameters(name)
        with pytest.raises(CapabilityError, match=name):
            engine.set_parameters(name, 1.0)


def test_bounds_are_kept(build, engine_class):
    """A value out of bounds is refused with its unit and bound, and nothing is written."""
    skip_without_parameter(engine_class, "body.mass")
    engine = build(worlds.drifting(count=2), 2)
    before = engine.get_parameters("body.mass")
    with pytest.raises(EngineError, match=r"body\.mass \[kg\] must be at least 0"):
        engine.set_parameters("body.mass", [[2.5, -1.0], [2.5, 2.5]])
    assert np.array_equal(engine.get_parameters("body.mass"), before)


# ---------------------------------------------------------------------- what they do


@needs(C.DYNAMICS)
def test_gravity_matters(build, engine_class):
    """Gravity per env: each ball falls by its own, from the next step on, also while under way."""
    skip_without_parameter(engine_class, "world.gravity")
    engine = build(worlds.falling_ball(), 3)
    engine.set_parameters("world.gravity", [[[0.0, 0.0, -1.62]]], env_ids=[1])
    engine.set_parameters("world.gravity", [[[1.0, 0.0, 0.0]]], env_ids=[2])
    engine.step(500)
    speed = engine.get_state().body_twist[:, 0, :3]
    wanted = np.array([[0.0, 0.0, -9.81], [0.0, 0.0, -1.62], [1.0, 0.0, 0.0]])
    assert_close(speed, wanted, 10 * tolerances.FALL_SPEED, "speeds after 1 s")


@needs(C.DYNAMICS, C.WRENCHES)
def test_mass_matters(build, engine_class):
    """The same force gives a heavier body less acceleration."""
    skip_without_parameter(engine_class, "body.mass")
    engine = build(worlds.drifting(), 2)
    engine.set_parameters("body.mass", [[8.0]], env_ids=[1])
    engine.apply_wrench([4.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0])
    engine.step(500)
    assert_close(
        engine.get_state().body_twist[:, 0, 0], np.array([2.0, 0.5]), 2 * tolerances.MOTION, "speeds after 1 s"
    )


@needs(C.DYNAMICS)
def test_link_mass_matters(build, engine_class):
    """The mass of a link changes too, not only that of free bodies."""
    skip_without_parameter(engine_class, "body.mass")
    engine = build(worlds.slider(), 2)
    engine.set_parameters("body.mass", [[8.0]], env_ids=[1], indices=[1])
    engine.set_control(effort=4.0)
    engine.step(500)
    assert_close(engine.get_state().joint_vel[:, 0], np.array([2.0, 0.5]), 2 * tolerances.MOTION, "speeds after 1 s")


@needs(C.DYNAMICS, C.WRENCHES)
def test_inertia_matters(build, engine_class):
    """The same torque gives a body of larger inertia less angular acceleration, about the axis that was changed."""
    skip_without_parameter(engine_class, "body.inertia")
    engine = build(worlds.spinning_ball(), 2)
    engine.set_parameters("body.inertia", [[[0.04, 0.05, 0.064, 0.0, 0.0, 0.0]]], env_ids=[1])
    engine.apply_wrench([0.0, 0.0, 0.0, 0.0, 0.0, 0.032], [0])
    engine.step(500)
    assert_close(engine.get_state().body_twist[:, 0, 5], np.array([1.0, 0.5]), 2 * tolerances.MOTION, "rates after 1 s")


@needs(C.DYNAMICS)
def test_centre_of_mass_matters(build, engine_class):
    """A body spinning freely turns about its centre of mass: the origin's speed shows where that is."""
    skip_without_parameter(engine_class, "body.com")
    engine = build(worlds.drifting(), 2)
    engine.set_parameters("body.com", [[[0.1, 0.0, 0.0]]], env_ids=[1])
    engine.set_body_state(twist=[0.0, 0.0, 0.0, 0.0, 0.0, np.pi])
    engine.step(500)
    place = engine.get_state().body_pose[:, 0, :2]
    # half a turn in 1 s; with the centre at +0.1 the origin, first at rest, ends 0.2 along x and drifts with the centre
    drift = np.pi * 0.1
    assert_close(place, np.array([[0.0, 0.0], [0.2, drift]]), 10 * tolerances.MOTION, "origins after half a turn")


@needs(C.DYNAMICS)
def test_damping_matters(build, engine_class):
    """A damped carriage coasts down as exp(-d t / m)."""
    skip_without_parameter(engine_class, "joint.damping")
    engine = build(worlds.slider(drive=False), 2)
    engine.set_parameters("joint.damping", [[3.0]], env_ids=[1])
    engine.set_joint_state(velocity=1.0)
    engine.step(500)
    speed = engine.get_state().joint_vel[:, 0]
    assert_close(speed, np.array([1.0, exp(-1.5)]), 2 * tolerances.MOTION, "speeds after 1 s")


@needs(C.DYNAMICS, C.ARMATURE)
def test_armature_matters(build, engine_class):
    """Armature adds to the inertia at the joint: 4 N on 2 + 2 kg."""
    skip_without_parameter(engine_class, "joint.armature")
    engine = build(worlds.slider(), 2)
    engine.set_parameters("joint.armature", [[2.0]], env_ids=[1])
    engine.set_control(effort=4.0)
    engine.step(500)
    assert_close(engine.get_state().joint_vel[:, 0], np.array([2.0, 1.0]), 2 * tolerances.MOTION, "speeds after 1 s")


@needs(C.DYNAMICS, C.JOINT_FRICTION)
def test_joint_friction_matters(build, engine_class):
    """Dry friction of 3 N takes 3 N off a drive of 4 N."""
    skip_without_parameter(engine_class, "joint.friction")
    engine = build(worlds.slider(friction=0.5), 2)
    engine.set_parameters("joint.friction", [[3.0]], env_ids=[1])
    engine.set_control(effort=4.0)
    engine.step(500)
    assert_close(engine.get_state().joint_vel[:, 0], np.array([1.75, 0.5]), 2 * tolerances.BLOCKED, "speeds after 1 s")


@needs(C.DYNAMICS)
def test_gains_matter(build, engine_class):
    """kp and kd per env: under 5 N of feed-forward a drive rests 5 / kp away, and overdamping is slower."""
    for name in ("actuator.kp", "actuator.kd"):
        skip_without_parameter(engine_class, name)
    engine = build(worlds.slider(ControlMode.POSITION, 100.0, 30.0), 3)
    engine.set_parameters("actuator.kp", [[50.0]], env_ids=[1])
    engine.set_parameters("actuator.kd", [[300.0]], env_ids=[2])
    engine.set_control(position=0.0, effort=5.0)
    engine.step(250)
    assert engine.get_state().joint_pos[2, 0] < 0.6 * engine.get_state().joint_pos[0, 0]
    engine.step(2000)
    assert_close(engine.get_state().joint_pos[:2, 0], np.array([0.05, 0.1]), tolerances.AT_REST, "positions at rest")


@needs(C.DYNAMICS, C.EFFORT_LIMITS)
def test_effort_limit_matters(build, engine_class):
    """The effort limit per env is what the drive is clipped to."""
    skip_without_parameter(engine_class, "actuator.effort_limit")
    engine = build(worlds.slider(ControlMode.POSITION, 1000.0, 1.0, 4.0), 2)
    engine.set_parameters("actuator.effort_limit", [[2.0]], env_ids=[1])
    engine.set_control(position=20.0)
    engine.step(500)
    assert_close(engine.get_state().joint_vel[:, 0], np.array([2.0, 1.0]), 2 * tolerances.BLOCKED, "speeds after 1 s")


@needs(C.DYNAMICS)
def test_friction_matters(build, engine_class):
    """A box that slides on the ground is stopped by mu g; per env, and by the larger of the two coefficients."""
    skip_without_parameter(engine_class, "geom.friction")
    engine = build(worlds.resting(Box((0.2, 0.2, 0.05)), 0.05), 2)
    engine.step(100)
    engine.set_parameters("geom.friction", [[0.2, 0.2], [0.1, 0.4]])
    engine.set_body_state(twist=[2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    engine.step(150)
    speed = engine.get_state().body_twist[:, 0, 0]
    for env, friction in enumerate((0.2, 0.4)):
        assert_ratio(2.0 - speed[env], friction * 9.81 * 0.3, tolerances.SLIDING, f"speed lost at friction {friction}")


@needs(C.RENDER_RGB)
def test_color_matters(build, engine_class):
    """A colour per env shows in that env's images and in no other's."""
    skip_without_parameter(engine_class, "geom.color")
    engine = build(worlds.scene(cameras=True), 2)
    before = engine.render("front")["rgb"]
    box = engine.index.geom("box")
    engine.set_parameters("geom.color", [[[1.0, 0.0, 0.0, 1.0]]], env_ids=[1], indices=[box])
    after = engine.render("front")["rgb"].astype(int)
    assert np.array_equal(after[0], before[0])
    redder = after[1] - before[1].astype(int)
    assert (redder[..., 0] - redder[..., 1] > 30).any(), "no pixel turned red"

"""Bullet's own motors (`actuation: native`): what they refuse, and that a robot that they move stays deterministic."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.errors import EngineError
from anysim.model.world import Actuation, ControlMode, World
from anysim.testing import worlds
from anysim.testing.compare import assert_same, read
from tests.parity.pressing import panda


def native(world: World) -> World:
    return worlds.actuated(world, Actuation.NATIVE)


def test_dry_friction_on_a_driven_joint_is_refused(build):
    """At the build and when it is set later: Bullet makes both of one motor."""
    slider = native(worlds.slider(ControlMode.POSITION, 100.0, 10.0))
    with pytest.raises(EngineError, match=r"one motor for both.*implicit_pd"):
        build(replace(slider, joints=(replace(slider.joints[0], friction=0.5),)))
    with pytest.raises(EngineError, match="one motor for both"):
        build(slider).set_parameters("joint.friction", 0.5)


def test_compensated_gravity_is_counted_in_steps(build):
    """The torques that carry the Panda do not depend on how its steps are split into calls."""
    whole, split = build(native(panda())), build(native(panda()))
    target = whole.control.position + 0.1
    for engine in (whole, split):
        engine.set_control(position=target)
    whole.step(37)
    for steps in (3, 14, 1, 19):
        split.step(steps)
    assert_same(read(split), read(whole), "37 steps in several calls")
    assert np.abs(whole.get_state().joint_effort).max() > 0.1


def test_a_snapshot_continues_exactly(build):
    """Motors, held torques and all: the run goes on bit for bit in another env."""
    engine = build(native(panda()), 2)
    engine.set_control(position=engine.control.position + 0.1)
    engine.step(33)
    saved = engine.snapshot([0])
    engine.step(50)
    wanted = read(engine, [0])
    engine.restore(saved, [1])
    engine.step(50, [1])
    assert_same(read(engine, [1]), wanted, "continued in env 1")


@pytest.mark.parametrize(
    "name", ["actuator.kp", "actuator.kd", "actuator.effort_limit", "joint.damping", "joint.armature", "body.com"]
)
def test_gains_that_are_kept_between_steps_follow_parameters_and_new_clients(build, name):
    """What was changed after some steps acts as if it had been changed before all of them."""
    early, late = build(native(panda()), num_envs=2), build(native(panda()), num_envs=2)
    home = early.control.position
    for step in range(3):
        late.set_control(position=home + 0.01 * step)
        late.step(10)
    for engine in (early, late):
        values = engine.get_parameters(name, [1])
        engine.set_parameters(name, values + 0.01 if name == "body.com" else 0.5 * values + 0.1, [1])
        engine.reset()
        for step in range(4):
            engine.set_control(position=home + 0.05 * step)
            engine.step(10)
    state = late.get_state()
    assert_same(read(late), read(early), f"{name} changed late and early")
    assert not np.array_equal(state.joint_vel[0], state.joint_vel[1]), "the change has no effect"


def test_gains_that_are_kept_between_steps_follow_modes(build):
    """A drive that was switched to effort and back moves as one that was not."""
    plain, switched = build(native(panda())), build(native(panda()))
    for engine in (plain, switched):
        engine.step(10)
    switched.set_control_mode(ControlMode.EFFORT, actuators=[3])
    switched.step(10)
    assert not np.array_equal(switched.get_state().joint_pos, plain.get_state().joint_pos)
    switched.set_control_mode(ControlMode.POSITION, actuators=[3])
    switched.step(1)
    for engine in (plain, switched):
        engine.reset()
        engine.set_control(position=engine.control.position + 0.05)
        engine.step(30)
    assert_same(read(switched), read(plain), "a drive switched to effort and back")

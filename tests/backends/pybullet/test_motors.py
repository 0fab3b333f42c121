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

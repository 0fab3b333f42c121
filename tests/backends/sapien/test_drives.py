"""The drive law, joint friction and limits, against their equations and against MuJoCo."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.model.world import Actuator, Box, ControlMode, JointType
from anysim.testing import worlds
from anysim.testing.sketch import Sketch, inertial

POSITION, VELOCITY, EFFORT = ControlMode.POSITION, ControlMode.VELOCITY, ControlMode.EFFORT
Z = (0.0, 0.0, 1.0)


def hinge(mode=POSITION, kp=0.0, kd=0.0, limit=np.inf, **joint):
    """One driven link that turns about z, with 0.02 kg m^2."""
    s = Sketch("hinge", gravity=(0.0, 0.0, 0.0))
    part = inertial(Box((0.1, 0.1, 0.1)), 3.0)
    link = s.link("link", s.robot("hinge"), JointType.REVOLUTE, Z, part, **joint)
    s.drive(link, mode, kp, kd, limit)
    return s.world()


@pytest.mark.parametrize(("kp", "kd", "damping"), [(100.0, 5.0, 0.0), (4500.0, 450.0, 0.0), (50.0, 1.0, 3.0)])
def test_a_drive_moves_as_implicit_damping_says(make, kp, kd, damping):
    """(I + dt (kd + d)) v' = I v + dt kp (q* - q): to single precision, also where dt kd is many times the inertia."""
    engine = make(hinge(kp=kp, kd=kd, damping=damping))
    engine.set_control(position=0.3)
    q = v = 0.0
    for _ in range(300):
        engine.step()
        v = (0.02 * v + 0.002 * kp * (0.3 - q)) / (0.02 + 0.002 * (kd + damping))
        q += 0.002 * v
        assert engine.get_state().joint_pos[0, 0] == pytest.approx(q, abs=2e-6)


def test_a_moving_drive_is_as_fast_as_it_says(make):
    """With the TGS solver a damped joint would be ten times slower here."""
    engine = make(hinge(VELOCITY, kd=50.0))
    engine.set_control(velocity=0.3)
    engine.step(500)
    assert engine.get_state().joint_vel[0, 0] == pytest.approx(0.3, rel=1e-4)


def test_the_limit_bounds_the_drive_and_not_the_damping_of_the_joint(make):
    """At 4 N m and 2 N m s/rad of passive damping the joint settles at 2 rad/s; the drive reports 4 N m."""
    engine = make(hinge(kp=1000.0, kd=10.0, limit=4.0, damping=2.0))
    engine.set_control(position=1000.0)
    engine.step(500)
    state = engine.get_state()
    assert state.joint_vel[0, 0] == pytest.approx(2.0, rel=1e-3)
    assert state.joint_effort[0, 0] == pytest.approx(4.0)


def test_passive_damping_may_exceed_the_limit(make):
    """A joint braked by its own damping brakes by all of it, though its drive may exert little."""
    engine = make(hinge(EFFORT, limit=0.001, damping=0.1))
    engine.set_joint_state(velocity=10.0)
    engine.step(100)
    assert engine.get_state().joint_vel[0, 0] == pytest.approx(10.0 * (1 + 0.002 * 0.1 / 0.02) ** -100, rel=1e-3)


@pytest.mark.parametrize("kind", list(JointType))
def test_dry_friction_is_a_force(make, kind):
    """2 N m hold against 1.9 and take 2 off 3, in both directions, for both kinds of joints."""
    s = Sketch("dry", gravity=(0.0, 0.0, 0.0))
    part = inertial(Box((0.1, 0.1, 0.1)), 3.0)
    link = s.link("link", s.robot("dry"), kind, Z, part, friction=2.0)
    s.drive(link, EFFORT)
    engine = make(s.world(), 4)
    engine.set_control(effort=[[1.9], [3.0], [-3.0], [-1.9]])
    engine.step(50)
    size = 3.0 if kind is JointType.PRISMATIC else 0.02
    wanted = np.array([0.0, 1.0, -1.0, 0.0]) * 0.1 / size
    assert engine.get_state().joint_vel[:, 0] == pytest.approx(wanted, abs=1e-3 / size)


def test_dry_friction_can_be_added_and_taken_away(make):
    """A joint that was built without it gets it per env, and loses it."""
    engine = make(hinge(EFFORT), 2)
    engine.set_parameters("joint.friction", [[0.5]], env_ids=[1])
    engine.set_control(effort=0.4)
    engine.step(50)
    assert engine.get_state().joint_vel[:, 0] == pytest.approx([2.0, 0.0], abs=1e-3)
    engine.set_parameters("joint.friction", [[0.0]], env_ids=[1])
    engine.step(50)
    assert engine.get_state().joint_vel[1, 0] == pytest.approx(2.0, abs=1e-2)


def test_one_drive_per_joint(make):
    """A second drive on a joint would replace the first in silence."""
    world = hinge(kp=10.0)
    second = Actuator("second", 0, POSITION, 1.0, 1.0)
    with pytest.raises(Exception, match="has two drives"):
        make(replace(world, actuators=(*world.actuators, second)))


@pytest.mark.parametrize("gains", [(1000.0, 100.0), (4500.0, 450.0)])
def test_an_arm_moves_as_in_mujoco(make, gains):
    """Under one tape of targets the joints agree far within the promise of 5e-3 rad in transient, 1e-3 at rest.

    Without effort limits: MuJoCo clips at the speed of the step's beginning, see its capabilities.
    """
    pytest.importorskip("mujoco", reason="the comparison needs the other engine")
    scene = worlds.scene()
    drives = tuple(replace(a, kp=gains[0], kd=gains[1], effort_limit=np.inf) for a in scene.actuators)
    world = replace(scene, actuators=drives)
    engines = [make(world), make(world, engine="mujoco")]
    rng, target = np.random.default_rng(0), np.array([[0.2, 0.0]])
    for _ in range(80):
        target = target + 0.04 * rng.standard_normal((1, 2))
        for engine in engines:
            engine.set_control(position=target)
            engine.step(10)
        ours, theirs = (engine.get_state().joint_pos for engine in engines)
        assert np.abs(ours - theirs).max() < 1e-3
    for engine in engines:
        engine.step(1000)
    ours, theirs = (engine.get_state() for engine in engines)
    assert np.abs(ours.joint_pos - theirs.joint_pos).max() < 1e-4
    assert np.abs(ours.joint_effort - theirs.joint_effort).max() < 1e-2

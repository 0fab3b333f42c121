"""Friction that PhysX does not report, from momentum."""

import numpy as np
import pytest

from anysim.model.world import Box, ContactSensor, JointType, Sphere, Surface
from anysim.testing.sketch import Sketch, inertial

G, FRICTION = 9.81, 0.5


def _foot(friction=0.0, joint=JointType.PRISMATIC):
    """A foot on rails, pressed on the ground; on it a small mass on a joint with dry friction."""
    s = Sketch("foot")
    s.ground(Surface(friction=FRICTION))
    base, part = s.robot("leg", (0.0, 0.0, 0.4)), inertial(Box((0.05, 0.05, 0.05)), 0.5)
    cross = s.link("cross", base, JointType.PRISMATIC, (1.0, 0.0, 0.0), inertial(Sphere(0.05), 1.0))
    down = s.link("down", cross, JointType.PRISMATIC, (0.0, 0.0, 1.0), part)
    foot = s.link("foot", down, JointType.REVOLUTE, (0.0, 1.0, 0.0), part, position=(0.0, 0.0, -0.3))
    s.shape(foot, Box((0.05, 0.05, 0.05)), surface=Surface(friction=FRICTION))
    axis = (1.0, 0.0, 0.0) if joint is JointType.PRISMATIC else (0.0, 1.0, 0.0)
    s.link("knob", foot, joint, axis, inertial(Sphere(0.05), 0.2), position=(0.05, 0.0, 0.2), friction=friction)
    for link in (cross, down, foot):
        s.drive(link, kp=2000.0, kd=100.0)
    s.sensors.append(ContactSensor("foot", (foot,)))
    return s.world()


@pytest.mark.parametrize(
    ("friction", "joint", "allowed"),
    [(0.0, JointType.PRISMATIC, 0.05), (0.2, JointType.PRISMATIC, 0.4), (0.2, JointType.REVOLUTE, 0.4)],
)
def test_a_sliding_foot_reads_its_friction(make, friction, joint, allowed):
    """On a link it is mu times the normal force, within what the joints below put in doubt."""
    engine = make(_foot(friction, joint))
    engine.set_control(position=[[0.0, -0.08, 0.0]])
    engine.step(300)
    engine.set_control(position=[[0.05, -0.08, 0.0]])
    engine.step(30)
    engine.set_joint_state(velocity=[[0.5]], joints=[3])
    engine.step(3)
    force = engine.get_state().contact_force[0, 0]
    assert engine.get_state().joint_vel[0, 0] > 0.01, "the foot does not slide"
    assert force[2] > 50.0
    assert force[0] == pytest.approx(-FRICTION * force[2], abs=allowed)


def test_a_floating_robot_stands_on_its_feet(make):
    """The feet of a free root carry its weight, with the side forces of legs that are spread: these cancel."""
    s = Sketch("walker")
    s.ground()
    body = s.free("body", Box((0.2, 0.1, 0.02)), (0.0, 0.0, 0.3), 2.0, collides=False)
    feet = []
    for name, x in (("front", 0.2), ("back", -0.2)):
        for side, y in (("left", 0.1), ("right", -0.1)):
            axis = (0.0, 0.0, 1.0)
            foot = s.link(
                f"{name}_{side}", body, JointType.PRISMATIC, axis, inertial(Sphere(0.03), 0.1), position=(x, y, -0.27)
            )
            s.shape(foot, Sphere(0.03))
            s.drive(foot, kp=2000.0, kd=50.0)
            feet.append(foot)
    s.sensors += [ContactSensor("all", tuple(feet)), *(ContactSensor(f"f{i}", (f,)) for i, f in enumerate(feet))]
    engine = make(s.world())
    engine.step(800)
    force = engine.get_state().contact_force[0]
    assert force[0] == pytest.approx([0.0, 0.0, 2.4 * G], abs=0.05)
    assert force[1:].sum(axis=0) == pytest.approx(force[0], abs=1e-9)
    assert force[1:, 2] == pytest.approx([0.6 * G] * 4, abs=0.1)


def test_what_lies_on_two_slabs_adds_up(make):
    """How two fixed things share is a guess; their sum, and the sensor of what lies on them, are not."""
    s = Sketch("bridge")
    tilt = (0.0, float(np.sin(0.1)), 0.0, float(np.cos(0.1)))  # 0.2 rad about y
    slabs = [
        s.fixed(f"slab{i}", Box((1.0, 0.1, 0.1)), (0.0, y, 0.0), quaternion=tilt) for i, y in enumerate((-0.3, 0.3))
    ]
    place = (0.15 * float(np.sin(0.2)), 0.0, 0.15 * float(np.cos(0.2)))
    box = s.free("box", Box((0.1, 0.35, 0.05)), place, 3.0, quaternion=tilt)
    s.sensors += [ContactSensor("box", (box,)), *(ContactSensor(f"s{i}", (b,)) for i, b in enumerate(slabs))]
    engine = make(s.world())
    engine.step(500)
    force = engine.get_state().contact_force[0]
    assert force[0] == pytest.approx([0.0, 0.0, 3.0 * G], abs=0.05)
    assert -force[1:].sum(axis=0) == pytest.approx(force[0], abs=1e-9)
    assert -force[1] == pytest.approx([0.0, 0.0, 1.5 * G], abs=1.0), "alike slabs share about alike"
    assert engine.contacts().force.shape[1] == 3


def test_no_friction_without_a_coefficient(make):
    """Rounding is not taken for friction: a smooth floor reads the normal force alone."""
    s = Sketch("ice")
    s.ground(Surface(friction=0.0))
    box = s.free("box", Box((0.1, 0.1, 0.05)), (0.0, 0.0, 0.05), 1.0, surface=Surface(friction=0.0))
    s.sensors.append(ContactSensor("box", (box,)))
    engine = make(s.world())
    engine.set_body_state(twist=[1.0, 0.5, 0.0, 0.0, 0.0, 0.0])
    engine.step(50)
    assert engine.get_state().contact_force[0, 0, :2] == pytest.approx([0.0, 0.0], abs=1e-5)
    assert engine.get_state().contact_force[0, 0, 2] == pytest.approx(G, rel=0.02)

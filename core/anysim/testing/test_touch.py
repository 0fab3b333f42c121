"""Contact forces with their friction, on scenes where statics gives them."""

from dataclasses import replace
from math import cos, radians, sin

import numpy as np

from anysim.conventions import WORLD
from anysim.engine.capability import Capability as C
from anysim.engine.state import SnapshotLevel
from anysim.model.world import Box, ContactSensor, JointType, Surface
from anysim.testing import tolerances, worlds
from anysim.testing.compare import assert_close, read
from anysim.testing.fixtures import needs
from anysim.testing.sketch import Sketch, inertial

pytestmark = needs(C.DYNAMICS, C.CONTACT_SENSORS)
G = 9.81
CARRIAGE, CUBE = 0.3, 0.2  # [kg] a finger and what is held
GRIP = 20.0  # [N]


def _forces(engine, env=0):
    names = [sensor.name for sensor in engine.world.contact_sensors]
    return dict(zip(names, engine.get_state().contact_force[env], strict=True))


def _felt(world, **sensors):
    made = tuple(ContactSensor(name, *which) for name, which in sensors.items())
    return replace(world, contact_sensors=made)


def test_a_block_on_a_slope_reads_its_weight(build):
    """At rest on a slope the normal force and the friction add up to the weight; a fixed slab feels the reaction."""
    world = _felt(worlds.slope(radians(20), 0.8), box=((1,),), slab=((0,),), pair=((1,), (0,)), none=((1,), (WORLD,)))
    engine = build(world, 2)
    engine.step(600)
    weight, got = np.array([0.0, 0.0, G]), _forces(engine, 1)
    assert_close(got["box"], weight, tolerances.WEIGHT * G, "the block")
    assert_close(got["pair"], weight, tolerances.WEIGHT * G, "the block against the slab")
    assert_close(got["slab"], -weight, tolerances.WEIGHT * G, "the slab")
    assert not got["none"].any(), "the block against what it does not touch"


def test_a_sliding_block_reads_its_friction(build):
    """While it slides the force on it is its normal force, and mu times it against the motion."""
    angle, friction = radians(30), 0.3
    engine = build(_felt(worlds.slope(angle, friction), box=((1,),)))
    engine.step(500)
    size, down = G * cos(angle), np.array([cos(angle), 0.0, -sin(angle)])
    wanted = size * np.array([sin(angle), 0.0, cos(angle)]) - friction * size * down
    total = np.zeros(3)
    for _ in range(100):
        engine.step()
        total += _forces(engine)["box"]
    assert_close(total / 100, wanted, tolerances.SLIDING * G, "force on the sliding block, mean of 0.1 s")


@needs(C.WRENCHES)
def test_a_pushed_block_reads_the_push(build):
    """Below slip friction is what it is pushed with, whatever the coefficient."""
    s = Sketch("push")
    s.ground()
    box = s.free("box", Box((0.1, 0.1, 0.05)), (0.0, 0.0, 0.05), 1.0)
    s.sensors.append(ContactSensor("box", (box,)))
    engine = build(s.world())
    engine.step(500)
    for _ in range(200):
        engine.apply_wrench([3.0, -1.0, 0.0, 0.0, 0.0, 0.0], [box])
        engine.step()
    assert_close(_forces(engine)["box"], np.array([-3.0, 1.0, G]), tolerances.WEIGHT * G, "force on the pushed block")


def _grip():
    """Two fingers on rails that press a cube in mid-air, 20 N each."""
    s = Sketch("grip")
    hand = s.robot("hand", (0.0, 0.0, 0.5))
    part, pads = inertial(Box((0.01, 0.02, 0.02)), CARRIAGE), Surface(softness=0.004, impedance=(0.99, 0.999))
    fingers: list[int] = []
    for name, side in (("left", 1.0), ("right", -1.0)):
        finger = s.link(
            name,
            hand,
            JointType.PRISMATIC,
            (0.0, -side, 0.0),
            part,
            position=(0.0, 0.03 * side, 0.0),
            gravity_compensation=True,
            armature=0.1,
        )
        s.shape(finger, Box((0.02, 0.01, 0.02)), surface=pads)
        fingers.append(finger)
    for finger in fingers:
        s.drive(finger, limit=GRIP)
    cube = s.free("cube", Box((0.02, 0.02, 0.02)), (0.0, 0.0, 0.5), CUBE, surface=pads)
    s.sensors += [
        ContactSensor("cube", (cube,)),
        ContactSensor("left", (fingers[0],)),
        ContactSensor("right", (fingers[1],)),
        ContactSensor("pair", (cube,), (fingers[0],)),
        ContactSensor("both", tuple(fingers), (cube,)),
    ]
    return s.world()


def test_a_gripped_cube_hangs_on_friction(build):
    """The cube reads its weight, each finger its grip, both together the weight.

    How two fingers that cannot give share the weight is not determined, and they may strain against each other.
    """
    engine = build(_grip(), 2)
    engine.set_control(effort=[[GRIP, GRIP]] * 2)
    engine.step(500)
    got, allowed = _forces(engine, 1), tolerances.WEIGHT * GRIP
    assert_close(got["cube"], np.array([0.0, 0.0, CUBE * G]), tolerances.WEIGHT * CUBE * G, "the cube")
    for name, side in (("left", 1.0), ("right", -1.0)):
        assert_close(got[name][1], side * GRIP, allowed, name)
        assert np.hypot(got[name][0], got[name][2]) < 0.8 * GRIP * 1.01, "friction within its cone"
    weight = np.array([0.0, 0.0, -CUBE * G])
    assert_close(got["left"] + got["right"], weight, tolerances.WEIGHT * CUBE * G, "the sum of the fingers")
    assert_close(got["both"], weight, tolerances.WEIGHT * CUBE * G, "both fingers against the cube")
    assert_close(got["pair"], -got["left"], 1e-6, "the cube against the finger")


def test_forces_are_of_the_last_step(build):
    """Reading costs nothing and writing changes nothing: forces stay those of the last step, in each env alone."""
    engine = build(_grip(), 2)
    engine.set_control(effort=[[GRIP, GRIP]] * 2)
    engine.step(400)
    engine.step(100, env_ids=[0])
    before = read(engine)
    snapshot = engine.snapshot(level=SnapshotLevel.STATE)
    engine.set_body_state(pose=[3.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], bodies=[engine.index.body("cube")])
    assert np.array_equal(engine.get_state().contact_force, before["contact_force"])
    engine.reset(env_ids=[1])
    assert np.array_equal(engine.get_state().contact_force[0], before["contact_force"][0])
    assert not engine.get_state().contact_force[1].any()
    engine.restore(snapshot)
    assert np.array_equal(engine.get_state().contact_force, before["contact_force"])


@needs(C.CONTACT_POINTS)
def test_points_and_sensors_agree(build):
    """The forces at a body's contact points, with friction, add up to what its sensor reads."""
    engine = build(_felt(worlds.slope(radians(15), 0.4), box=((1,),)))
    engine.step(500)
    points = engine.contacts()
    on_box = (points.force * np.where(points.body_b == 1, 1.0, -1.0)[:, None]).sum(axis=0)
    assert_close(on_box, _forces(engine)["box"], tolerances.WEIGHT * G, "sum over the points")

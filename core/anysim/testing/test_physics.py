"""Worlds whose motion is known by hand. All need an engine with dynamics."""

from dataclasses import replace
from math import asin, cos, radians, sin, sqrt
from typing import Any

import numpy as np
import pytest

from anysim.engine.capability import Capability as C
from anysim.math import pose as P
from anysim.model.world import Actuation, Box, Capsule, ControlMode, Cylinder, Sphere, Surface
from anysim.testing import tolerances, worlds
from anysim.testing.compare import assert_close, assert_ratio
from anysim.testing.fixtures import needs
from anysim.testing.sketch import inertial

pytestmark = needs(C.DYNAMICS)
G = 9.81


# ---------------------------------------------------------------------- free bodies


def test_free_fall(build):
    """A ball falls g t^2 / 2 and has the speed g t."""
    engine = build(worlds.falling_ball(20.0))
    engine.step(500)
    state = engine.get_state()
    assert_ratio(state.body_twist[0, 0, 2], -G, tolerances.FALL_SPEED, "speed after 1 s")
    assert_ratio(20.0 - state.body_pose[0, 0, 2], G / 2, tolerances.MOTION, "distance after 1 s")


def test_a_throw_is_a_parabola(build):
    """A thrown body keeps its horizontal speed; its centre of mass, off the origin, flies a parabola while it spins."""
    com = np.array([0.1, -0.05, 0.2])
    engine = build(worlds.drifting(tuple(com), gravity=(0.0, 0.0, -G)))
    start = engine.get_state().body_pose[0, 0]
    rate, velocity = np.array([0.0, 0.0, 3.0]), np.array([1.0, 0.5, 4.0])
    centre = start[:3] + P.rotate(start[3:], com)
    speed = velocity + np.cross(rate, centre - start[:3])
    engine.set_body_state(twist=[*velocity, *rate])
    engine.step(400)
    pose = engine.get_state().body_pose[0, 0]
    wanted = centre + speed * 0.8 - np.array([0.0, 0.0, G / 2 * 0.64])
    assert_close(pose[:3] + P.rotate(pose[3:], com), wanted, 4 * tolerances.MOTION, "centre of mass after 0.8 s")


def test_nothing_slows_a_free_body(build):
    """Without forces a body keeps its speed and its spin, also a fast one: engines' default damping is off."""
    engine = build(worlds.spinning_ball())
    twist = np.array([5.0, 0.0, 0.0, 0.0, 0.0, 80.0])
    engine.set_body_state(twist=twist)
    engine.step(500)
    got = engine.get_state().body_twist[0, 0]
    assert_ratio(got[0], 5.0, tolerances.COASTING, "speed after 1 s")
    assert_ratio(got[5], 80.0, tolerances.SPIN, "spin after 1 s")


def test_angular_momentum_is_kept(build):
    """A box that tumbles about no principal axis keeps its angular momentum in the world."""
    world = worlds.drifting(dt=0.0005)
    engine = build(world)
    engine.set_body_state(twist=[0.0, 0.0, 0.0, 2.0, 3.0, 1.0])
    moments = np.array(world.bodies[0].inertial.inertia[:3])

    def momentum():
        state = engine.get_state()
        turn, rate = state.body_pose[0, 0, 3:], state.body_twist[0, 0, 3:]
        return P.rotate(turn, moments * P.rotate_inverse(turn, rate))

    before = momentum()
    engine.step(2000)
    assert_close(momentum(), before, tolerances.ENERGY * np.linalg.norm(before), "angular momentum after 1 s")


@needs(C.RESTITUTION)
@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9])
def test_collisions_keep_momentum(build, engine_class, restitution):
    """Two spheres collide: momentum stays, and the speeds part by e times the approach."""
    engine = build(worlds.colliding(restitution))
    engine.set_body_state(twist=[[[2.0, 0, 0, 0, 0, 0], [-1.0, 0, 0, 0, 0, 0]]])
    engine.step(600)
    left, right = engine.get_state().body_twist[0, :, 0]
    assert abs(left + 2.0 * right) < tolerances.MOMENTUM * 4.0, "the sum of momenta was 0 and is no more"
    assert right > left - 0.05, "they pass through each other"
    exact = engine_class.capabilities.supported[C.RESTITUTION].exact
    allowed = tolerances.RESTITUTION["exact" if exact else "approximate"]
    assert_close((right - left) / 3.0, restitution, allowed, "ratio of speeds after and before")


def test_excluded_pairs_pass_through(build):
    """Bodies of an excluded pair do not feel each other."""
    engine = build(replace(worlds.colliding(0.0), excluded_pairs=frozenset({(0, 1)})))
    twist = np.array([[[2.0, 0, 0, 0, 0, 0], [-1.0, 0, 0, 0, 0, 0]]])
    engine.set_body_state(twist=twist)
    engine.step(300)
    assert_close(engine.get_state().body_twist, twist, tolerances.READ_BACK * 2, "twists of bodies that passed")


# ---------------------------------------------------------------------- joints


@pytest.mark.parametrize("amplitude", [0.1, 1.0])
def test_pendulum_period(build, amplitude):
    """T = 2 pi sqrt(I / (m g l)) (1 + a^2/16 + 11 a^4/3072 + 173 a^6/737280), with the ball's own inertia in I."""
    length, dt = 0.5, 0.001
    engine = build(worlds.pendulum(length, dt))
    bob = engine.world.bodies[1].inertial
    pivot = bob.inertia[0] + bob.mass * length**2
    a = amplitude
    wanted = (
        2 * np.pi * sqrt(pivot / (bob.mass * G * length)) * (1 + a**2 / 16 + 11 * a**4 / 3072 + 173 * a**6 / 737280)
    )
    engine.set_joint_state(amplitude)
    angles = [amplitude]
    for _ in range(4000):
        engine.step()
        angles.append(float(engine.get_state().joint_pos[0, 0]))
    angle = np.array(angles)
    down = np.flatnonzero((angle[:-1] > 0) & (angle[1:] <= 0))
    crossings = (down + angle[down] / (angle[down] - angle[down + 1])) * dt
    assert len(crossings) >= 2
    assert_ratio(np.diff(crossings).mean(), wanted, tolerances.PERIOD, "period")
    assert_ratio(angle[-1500:].max(), amplitude, 4 * tolerances.ENERGY, "amplitude 3 s later")


@needs(C.JOINT_SPRINGS)
def test_a_spring_swings_about_its_rest(build):
    """T = 2 pi sqrt(m / k) about the rest, and energy stays: no engine damps a spring, or takes it for a drive."""
    mass, stiffness, rest, dt = 2.0, 50.0, 0.2, 0.001
    engine = build(worlds.slider(drive=False, mass=mass, stiffness=stiffness, spring_rest=rest, dt=dt))
    swing, speeds = [-rest], [0.0]
    for _ in range(3000):
        engine.step()
        state = engine.get_state()
        swing.append(float(state.joint_pos[0, 0]) - rest)
        speeds.append(float(state.joint_vel[0, 0]))
    way, speed = np.array(swing), np.array(speeds)
    down = np.flatnonzero((way[:-1] > 0) & (way[1:] <= 0))
    crossings = (down + way[down] / (way[down] - way[down + 1])) * dt
    assert len(crossings) == 2
    assert_ratio(np.diff(crossings).mean(), 2 * np.pi * sqrt(mass / stiffness), tolerances.PERIOD, "period")
    energy = 0.5 * mass * speed**2 + 0.5 * stiffness * way**2
    start = 0.5 * stiffness * rest**2
    assert_close(energy, np.full(len(energy), start), tolerances.ENERGY * start, "energy over 3 s")


@needs(C.JOINT_SPRINGS, C.CONTROL_POSITION)
@pytest.mark.parametrize("limit", [np.inf, 3.0])
def test_a_spring_pulls_beside_the_drive(build, limit):
    """At rest kp (q* - q) = k (q - q0), or the effort limit, which bounds the drive and not the spring."""
    kp, stiffness, rest = 100.0, 50.0, -0.1
    joint: dict[str, Any] = {"stiffness": stiffness, "spring_rest": rest, "damping": 20.0}
    engine = build(worlds.slider(ControlMode.POSITION, kp, 30.0, limit, **joint))
    engine.set_control(position=0.2)
    engine.step(3000)
    state, wanted = engine.get_state(), (kp * 0.2 + stiffness * rest) / (kp + stiffness)
    if np.isfinite(limit):
        wanted = rest + limit / stiffness
    assert_close(state.joint_pos[0, 0], wanted, tolerances.AT_REST, "position at rest")
    assert_close(state.joint_effort[0, 0], stiffness * (wanted - rest), tolerances.AT_REST * kp, "effort of the drive")


@needs(C.JOINT_SPRINGS, C.CONTROL_EFFORT, C.ACTUATION_NATIVE)
def test_a_spring_pulls_under_native_actuation(build):
    """It is no part of a drive, nor of one that the engine computes: 3 N hold it 3 / k from its rest."""
    world = worlds.slider(stiffness=50.0, spring_rest=-0.1, damping=20.0)
    engine = build(worlds.actuated(world, Actuation.NATIVE))
    engine.set_control(effort=3.0)
    engine.step(3000)
    assert_close(engine.get_state().joint_pos[0, 0], -0.1 + 3.0 / 50.0, tolerances.AT_REST, "position at rest")


def test_double_pendulum_keeps_its_energy(build):
    """Two undamped links keep kinetic plus potential energy while they exchange it."""
    engine = build(worlds.double_pendulum())
    bodies = engine.world.bodies[1:]

    def energy():
        state, total, kinetic = engine.get_state(), 0.0, 0.0
        for i, body in enumerate(bodies, start=1):
            pose, twist, part = state.body_pose[0, i], state.body_twist[0, i], body.inertial
            arm = P.rotate(pose[3:], np.array(part.com))
            speed, rate = twist[:3] + np.cross(twist[3:], arm), P.rotate_inverse(pose[3:], twist[3:])
            moving = 0.5 * part.mass * speed @ speed + 0.5 * (np.array(part.inertia[:3]) * rate) @ rate
            kinetic += moving
            total += moving + part.mass * G * (pose[2] + arm[2])
        return total, kinetic

    start, turned_over = energy()[0], 0.0
    for _ in range(40):
        engine.step(100)
        total, kinetic = energy()
        turned_over = max(turned_over, kinetic)
        assert abs(total - start) < tolerances.ENERGY * max(turned_over, 1.0)
    assert turned_over > 1.0, "the pendulum hardly moved"


@pytest.mark.parametrize("drive", [False, True], ids=["no-drive", "idle-drive"])
def test_nothing_slows_a_free_joint(build, drive):
    """A joint without damping, friction or command coasts: engines' default motors, friction and damping are off."""
    engine = build(worlds.slider(drive=drive))
    engine.set_joint_state(velocity=3.0)
    engine.step(500)
    assert_ratio(engine.get_state().joint_vel[0, 0], 3.0, tolerances.COASTING, "speed after 1 s")
    assert_ratio(engine.get_state().joint_pos[0, 0], 3.0, tolerances.COASTING, "distance after 1 s")


def test_a_drive_carries_its_load(build):
    """At rest against gravity a drive reports the weight, and sags by weight / kp."""
    up: dict[str, Any] = {"gravity": (0.0, 0.0, -G), "axis": (0.0, 0.0, 1.0)}
    engine = build(worlds.slider(ControlMode.POSITION, 2000.0, 200.0, **up))
    engine.step(1500)
    state = engine.get_state()
    assert_ratio(state.joint_effort[0, 0], 2.0 * G, tolerances.BLOCKED, "effort")
    assert_close(state.joint_pos[0, 0], -2.0 * G / 2000.0, tolerances.AT_REST, "sag")


def test_joint_limits_hold_a_load(build):
    """A load without a drive comes to rest at the limit."""
    engine = build(worlds.slider(drive=False, gravity=(0.0, 0.0, -G), axis=(0.0, 0.0, 1.0), lower=-0.1, damping=5.0))
    engine.step(1500)
    assert_close(engine.get_state().joint_pos, -0.1, tolerances.LIMIT, "position")
    assert_close(engine.get_state().joint_vel, 0.0, tolerances.LIMIT, "speed")


# ---------------------------------------------------------------------- contacts


def test_friction_holds_on_a_gentle_slope(build):
    """Below the friction angle a block stays."""
    engine = build(worlds.slope(radians(20), 0.6))
    engine.step(500)
    start = engine.get_state().body_pose[0, 1, :3]
    engine.step(1000)
    assert np.linalg.norm(engine.get_state().body_pose[0, 1, :3] - start) < tolerances.CREEP


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_block_slides_down_a_steep_slope(build, friction):
    """Above the friction angle a block slides with g (sin a - mu cos a)."""
    angle = radians(30)
    engine = build(worlds.slope(angle, friction))
    engine.step(200)
    early = engine.get_state().body_twist[0, 1, :3]
    engine.step(400)
    gained = np.linalg.norm(engine.get_state().body_twist[0, 1, :3] - early)
    assert_ratio(gained / 0.4, G * (sin(angle) - friction * cos(angle)), tolerances.SLIDING, "acceleration")


@pytest.mark.parametrize(("box", "slab"), [(0.1, 0.7), (0.7, 0.1)])
def test_the_larger_friction_counts(build, box, slab):
    """The friction of a pair is the larger of the two: 0.7 holds at 25 degrees on either side."""
    engine = build(worlds.slope(radians(25), box, slab))
    engine.step(500)
    start = engine.get_state().body_pose[0, 1, :3]
    engine.step(1000)
    assert np.linalg.norm(engine.get_state().body_pose[0, 1, :3] - start) < tolerances.CREEP


def test_priority_decides(build):
    """Of two surfaces that differ in priority the higher one decides alone: a smooth one of priority 1 lets slide."""
    world = worlds.slope(radians(25), 0.0, 0.7)
    smooth = replace(world.geoms[1], surface=Surface(friction=0.0, priority=1))
    engine = build(replace(world, geoms=(world.geoms[0], smooth)))
    engine.step(500)
    speed = np.linalg.norm(engine.get_state().body_twist[0, 1, :3])
    assert_ratio(speed, G * sin(radians(25)) * 0.5, tolerances.SLIDING, "speed after 0.5 s")


@needs(C.RESTITUTION)
@pytest.mark.parametrize("restitution", [0.5, 0.8])
def test_bounce_height(build, engine_class, restitution):
    """A ball dropped from h comes back to e^2 h; the larger restitution of the pair counts."""
    engine = build(worlds.bouncing_ball(restitution))
    heights = []
    for _ in range(900):
        engine.step()
        heights.append(float(engine.get_state().body_pose[0, 0, 2]))
    hit = int(np.argmin(heights[:450]))
    exact = engine_class.capabilities.supported[C.RESTITUTION].exact
    allowed = tolerances.BOUNCE["exact" if exact else "approximate"]
    assert_ratio(max(heights[hit:]) - 0.1, 0.5 * restitution**2, allowed, "height of the bounce")


def test_no_bounce_without_restitution(build):
    """A ball without restitution stays down."""
    engine = build(worlds.bouncing_ball(0.0))
    engine.step(340)
    highest = 0.0
    for _ in range(400):
        engine.step()
        highest = max(highest, float(engine.get_state().body_pose[0, 0, 2]))
    assert highest - 0.1 < 0.02


RESTING = {
    "box": (Box((0.1, 0.2, 0.3)), 0.3), "sphere": (Sphere(0.15), 0.15),
    "cylinder": (Cylinder(0.1, 0.15), 0.15), "capsule": (Capsule(0.2, 0.1), 0.3),
}  # fmt: skip


@pytest.mark.parametrize(("shape", "height"), RESTING.values(), ids=RESTING.keys())
def test_resting_height(build, shape, height):
    """A body comes to rest with its surface on the ground: sizes are half sizes, cylinders and capsules are along z."""
    # the capsule would tip over: a heavy foot keeps it upright
    inertia = inertial(shape, 1.0, (0.0, 0.0, -height / 2)) if isinstance(shape, Capsule) else None
    engine = build(worlds.resting(shape, height, 1.0, 0.01, inertia))
    engine.step(1000)
    state = engine.get_state()
    assert_close(state.body_pose[0, 0, 2], height, tolerances.REST_HEIGHT, "height")
    upright = P.rotate(state.body_pose[0, 0, 3:], np.array([0.0, 0.0, 1.0]))
    assert asin(min(1.0, float(np.hypot(*upright[:2])))) < 0.02, "it fell over"
    at = state.body_pose[0, 0, :2]
    engine.step(1500)
    assert_close(engine.get_state().body_pose[0, 0, :2], at, tolerances.CREEP, "drift in 3 s")


def test_a_mesh_rests_on_its_hull(build):
    """A mesh collides where its vertices are, in its own frame."""
    engine = build(worlds.resting_mesh())
    engine.step(1000)
    pose = engine.get_state().body_pose[0, 0]
    assert_close(pose[:3], 0.0, tolerances.REST_HEIGHT, "the corner that is the mesh's frame")


def test_heightfields_are_where_they_say(build):
    """A height field's rows run along y, its columns along x, from the lowest; heights are absolute."""
    engine = build(worlds.on_heightfield())
    engine.step(750)
    heights = engine.get_state().body_pose[0, :, 2]
    assert_close(heights, np.array([0.6, 0.2]), 2 * tolerances.REST_HEIGHT, "balls on the high and the low half")


def test_what_rests_wakes_up(build):
    """A body that lay still for long falls when its support is taken away: sleeping is no state of the contract."""
    engine = build(worlds.scene())
    engine.step(1500)
    box, table = engine.index.body("box"), engine.index.body("table")
    before = engine.get_state().body_pose[0, box, 2]
    engine.set_body_state(pose=[5.0, 5.0, 0.05, 0.0, 0.0, 0.0, 1.0], bodies=[table])
    engine.step(50)
    assert before - engine.get_state().body_pose[0, box, 2] > 0.03

"""Fixed tendons, and frames that are held together, against motion that is known."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np

from anysim.engine.capability import Capability as C
from anysim.engine.state import SnapshotLevel
from anysim.model.world import Actuation, ConstraintKind, ControlMode, Mimic
from anysim.testing import coupled, tolerances, worlds
from anysim.testing.compare import assert_close, assert_ratio
from anysim.testing.fixtures import needs

pytestmark = needs(C.DYNAMICS)

G = coupled.G


def _length(engine):
    return float(engine.get_state().joint_pos[0] @ np.array(coupled.SHARES))


def _period(values, dt):
    """The mean time between downward crossings of zero."""
    down = np.flatnonzero((values[:-1] > 0) & (values[1:] <= 0))
    crossings = (down + values[down] / (values[down] - values[down + 1])) * dt
    assert len(crossings) >= 2
    return float(np.diff(crossings).mean())


# ---------------------------------------------------------------------- tendons


@needs(C.TENDONS)
def test_a_tendon_swings_by_the_inertia_along_it(build):
    """T = 2 pi / sqrt(k sum c^2 / m); momentum across the tendon stays none, and energy what it was."""
    stiffness, dt = 50.0, 0.001
    engine = build(coupled.pair(stiffness=stiffness))
    places, speeds = [engine.get_state().joint_pos[0].copy()], [np.zeros(2)]
    for _ in range(2500):
        engine.step()
        state = engine.get_state()
        places.append(state.joint_pos[0].copy())
        speeds.append(state.joint_vel[0].copy())
    place, speed = np.array(places), np.array(speeds)
    masses, shares = np.array(coupled.MASSES), np.array(coupled.SHARES)
    length = place @ shares
    wanted = 2 * pi / sqrt(stiffness * float((shares**2 / masses).sum()))
    assert_ratio(_period(length, dt), wanted, tolerances.PERIOD, "period")
    across = (speed * masses) @ np.array([shares[1], -shares[0]])
    assert_close(across, np.zeros(len(across)), tolerances.READ_BACK, "momentum across the tendon")
    energy = 0.5 * (speed**2) @ masses + 0.5 * stiffness * length**2
    start = 0.5 * stiffness * 0.1**2
    assert_close(energy, np.full(len(energy), start), tolerances.ENERGY * start, "energy over 2.5 s")


@needs(C.TENDONS)
def test_a_tendon_is_slack_inside_of_its_rest(build):
    """Between the ends of its rest a tendon pulls at nothing, beyond them to the nearer one."""
    engine = build(coupled.pair(stiffness=50.0, rest=(0.05, 0.2)))
    engine.step(300)
    assert_close(engine.get_state().joint_pos[0], [0.1, 0.0], tolerances.READ_BACK, "positions in the rest")
    engine.set_joint_state(position=[0.3, 0.0], velocity=[0.0, 0.0])
    engine.step(10)
    rate = -50.0 * 0.1 * np.array(coupled.SHARES) / np.array(coupled.MASSES) * 0.01
    assert_close(engine.get_state().joint_vel[0], rate, 0.01 * float(np.abs(rate).max()), "velocities after 10 ms")


@needs(C.TENDONS, C.CONTROL_POSITION, C.ACTUATION_NATIVE)
def test_a_tendon_pulls_beside_drives(build):
    """At rest kp (q* - q) is what the tendon pulls with, as anysim and the engine compute the drive."""
    for actuation in (Actuation.IMPLICIT_PD, Actuation.NATIVE):
        world = coupled.pair(ControlMode.POSITION, 0.0, 0.002, stiffness=50.0, damping=1.0)
        drives = (replace(world.actuators[0], shares=()),)
        joints = tuple(replace(joint, damping=4.0) for joint in world.joints)
        engine = build(replace(worlds.actuated(world, actuation), actuators=drives, joints=joints))
        engine.set_control(position=0.2)
        engine.step(2500)
        assert_close(engine.get_state().joint_pos[0], [0.2, 0.4], tolerances.AT_REST, f"positions at rest, {actuation}")


@needs(C.TENDON_LIMITS)
def test_a_tendon_keeps_its_limits_and_its_length(build):
    """A length stays between its limits; one whose limits are equal stays there, and the sliders share the momentum."""
    engine = build(coupled.pair(lower=-0.05, upper=0.12))
    engine.set_joint_state(position=[0.1, 0.0], velocity=[0.5, 0.0])
    lengths = []
    for _ in range(400):
        engine.step()
        lengths.append(_length(engine))
    assert -0.05 - tolerances.LIMIT < min(lengths), min(lengths)
    assert 0.1 < max(lengths) < 0.12 + 0.1 * tolerances.LIMIT, max(lengths)
    engine = build(coupled.pair(lower=0.1, upper=0.1))
    engine.set_joint_state(position=[0.1, 0.0], velocity=[0.5, 1.0])
    engine.step(400)
    assert_close(_length(engine), 0.1, tolerances.AT_REST, "held length")
    assert_close(engine.get_state().joint_vel[0], [0.5, 1.0], tolerances.AT_REST, "velocities along the held length")


@needs(C.TENDON_DRIVES)
def test_a_drive_pulls_at_all_joints_of_its_tendon(build):
    """A force on the tendon moves each slider by its share; a target holds the length and not a joint."""
    engine = build(coupled.pair(ControlMode.EFFORT, 0.0))
    engine.set_control(effort=2.0)
    engine.step(400)
    rate = 2.0 * np.array(coupled.SHARES) / np.array(coupled.MASSES) * 0.4
    assert_close(engine.get_state().joint_vel[0], rate, tolerances.MOTION * float(rate.max()), "velocities after 0.4 s")
    engine = build(coupled.pair(ControlMode.POSITION, 0.1))
    engine.set_control(position=0.3)
    engine.step(3000)
    assert_close(_length(engine), 0.3, tolerances.AT_REST, "length at rest")
    shift = 0.2 / float((np.array(coupled.SHARES) ** 2 / coupled.MASSES).sum())
    wanted = np.array([0.1, 0.0]) + shift * np.array(coupled.SHARES) / np.array(coupled.MASSES)
    assert_close(engine.get_state().joint_pos[0], wanted, tolerances.AT_REST, "positions at rest")


@needs(C.SPATIAL_TENDONS)
def test_a_string_through_space_pulls_by_its_length(build):
    """Energy is that of the string's length, pulley and all; a string that is limited keeps its length."""
    stiffness, rest = 80.0, 0.6
    engine = build(coupled.strung(stiffness=stiffness, rest=(rest, rest)))
    places, speeds = [], []
    for _ in range(1500):
        engine.step()
        state = engine.get_state()
        places.append(float(state.joint_pos[0, 0]))
        speeds.append(float(state.joint_vel[0, 0]))
    place, speed = np.array(places), np.array(speeds)
    assert np.ptp(place) > 0.1
    energy = 0.5 * coupled.MASSES[0] * speed**2 + 0.5 * stiffness * (coupled.strung_length(place) - rest) ** 2
    start = 0.5 * stiffness * (coupled.strung_length(np.array(0.4)) - rest) ** 2
    assert_close(energy, np.full(len(energy), start), tolerances.ENERGY * start, "energy over 1.5 s")
    most = float(coupled.strung_length(np.array(0.5)))
    engine = build(coupled.strung(upper=most))
    engine.set_joint_state(position=[0.4], velocity=[0.5])
    longest = 0.0
    for _ in range(600):
        engine.step()
        longest = max(longest, float(coupled.strung_length(engine.get_state().joint_pos[0, 0])))
    assert abs(longest - most) < tolerances.LIMIT, longest


@needs(C.MIMIC_CURVES)
def test_a_joint_follows_a_curve(build):
    """A follower is where the polynomial puts it, when its leader is written and in motion."""
    mimic = Mimic(0, 0.2, 0.01, (3.0, -2.0))
    world = worlds.gripper()
    left, right = world.joints
    engine = build(replace(world, joints=(left, replace(right, mimic=mimic))))
    engine.set_joint_state([0.05], [0.1], joints=[0])
    state = engine.get_state()
    assert_close(state.joint_pos[0, 1], mimic.position(0.05), tolerances.READ_BACK, "place of the follower")
    assert_close(state.joint_vel[0, 1], 0.1 * mimic.rate(0.05), tolerances.READ_BACK, "speed of the follower")
    engine.set_control(position=0.09)
    for _ in range(50):
        engine.step(10)
        leader, follower = engine.get_state().joint_pos[0]
        assert_close(follower, mimic.position(leader), tolerances.FOLLOWER, "place of the follower in motion")
    assert_close(leader, 0.09, 0.02, "leader at its target")


# ---------------------------------------------------------------------- frames that are held together


@needs(C.CONNECTS)
def test_a_rod_swings_about_the_point_that_holds_it(build):
    """T = 2 pi sqrt(I / (m g l)) (1 + a^2 / 16), and the two points stay one."""
    world, dt = coupled.hung(ConstraintKind.CONNECT), 0.001
    engine, body = build(world), world.bodies[0].inertial
    arm = coupled.HUNG - 0.02
    moment = body.inertia[1] + body.mass * arm**2
    sway, away = [], 0.0
    for _ in range(2600):
        engine.step()
        state = engine.get_state()
        sway.append(float(state.body_pose[0, 0, 0]) - world.constraints[0].other_position[0])
        away = max(away, coupled.gaps(world, state)[0])
    wanted = 2 * pi * sqrt(moment / (body.mass * G * arm)) * (1 + 0.1**2 / 16)
    assert_ratio(_period(np.array(sway), dt), wanted, tolerances.PERIOD, "period")
    assert away < tolerances.HELD, f"the points are {away:.2g} m apart"


@needs(C.CONNECTS)
def test_a_loop_of_four_bars_swings_as_one(build):
    """T = 2 pi sqrt(I / K) of two rods and a bar between them, which stays level and closed."""
    world, dt = coupled.four_bar(), 0.001
    engine, rod = build(world), world.bodies[1].inertial
    angles, away = [], 0.0
    for _ in range(2000):
        engine.step()
        state = engine.get_state()
        angles.append(state.joint_pos[0].copy())
        away = max(away, coupled.gaps(world, state)[0])
    angle = np.array(angles)
    moment = 2 * (rod.inertia[1] + rod.mass * 0.2**2) + 0.4 * 0.4**2
    pull = (2 * rod.mass * 0.2 + 0.4 * 0.4) * G
    wanted = 2 * pi * sqrt(moment / pull) * (1 + 0.3**2 / 16)
    assert_ratio(_period(angle[:, 0], dt), wanted, tolerances.PERIOD, "period")
    assert_close(angle[:, 2], angle[:, 0], tolerances.HELD * 10, "the second rod beside the first")
    assert away < tolerances.HELD, f"the loop is {away:.2g} m open"


@needs(C.WELDS)
def test_welded_bodies_turn_as_one(build):
    """Two boxes that are pushed apart and turned move as one body of their mass and inertia, with the same momentum."""
    world = coupled.welded()
    engine = build(world)
    engine.apply_wrench([0.0, 0.0, 0.0, 0.0, 0.0, 0.5], [0])
    engine.step(400)
    state = engine.get_state()
    away, turned = coupled.gaps(world, state)
    assert away < tolerances.HELD, f"the frames are {away:.2g} m apart"
    assert turned < 10 * tolerances.HELD, f"the frames are {turned:.2g} rad apart"
    one, other = (body.inertial for body in world.bodies)
    arm = np.array([0.16, 0.0, 0.1])  # from one centre of mass to the other
    inertia = np.diag([a + b for a, b in zip(one.inertia[:3], other.inertia[:3], strict=True)])
    inertia += one.mass * other.mass / (one.mass + other.mass) * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    rate = np.linalg.solve(inertia, [0.0, 0.0, 0.5]) * 0.1
    engine.reset()
    engine.apply_wrench([0.0, 0.0, 0.0, 0.0, 0.0, 0.5], [0])
    engine.step(100)
    twist = engine.get_state().body_twist[0]
    assert_close(twist[0, 3:], rate, 0.02 * float(np.abs(rate).max()), "rates after 0.1 s")
    assert_close(twist[1, 3:], twist[0, 3:], 0.02 * float(np.abs(rate).max()), "rates of the other")


@needs(C.CONNECTS, C.SNAPSHOT_TRAJECTORY)
def test_a_closed_loop_goes_on_from_a_snapshot(build):
    """A loop that is restored moves on with the same bits, and so does one that is reset."""
    engine = build(coupled.four_bar())
    engine.step(100)
    first = engine.get_state().joint_pos.copy()
    kept = engine.snapshot(level=SnapshotLevel.TRAJECTORY)
    engine.step(100)
    after = engine.get_state().joint_pos.copy()
    engine.restore(kept)
    engine.step(100)
    assert np.array_equal(engine.get_state().joint_pos, after), "restored"
    engine.reset()
    engine.step(100)
    assert np.array_equal(engine.get_state().joint_pos, first), "reset"

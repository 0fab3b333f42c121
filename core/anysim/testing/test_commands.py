"""Drives and wrenches: they persist or they do not, and they exert what they say."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.engine.capability import Capability as C
from anysim.model.world import Actuation, ControlMode
from anysim.testing import tolerances, worlds
from anysim.testing.compare import assert_close, assert_ratio, assert_same, read, tape
from anysim.testing.fixtures import needs


def test_position_drive_reaches_its_target(build):
    """A free position drive settles on its target."""
    engine = build(worlds.slider(ControlMode.POSITION, 200.0, 40.0))
    engine.set_control(position=0.2)
    engine.step(1500)
    assert_close(engine.get_state().joint_pos, 0.2, tolerances.AT_REST, "position at rest")
    assert_close(engine.get_state().joint_vel, 0.0, tolerances.AT_REST, "speed at rest")


def test_commands_persist(build):
    """A command holds until it is written again: sent once or before every step is the same, bit for bit."""
    world = worlds.scene()
    once, always = build(world, 2), build(world, 2)
    target = tape(world, [0, 1], 8)[-1]
    once.set_control(position=target)
    for _ in range(60):
        always.set_control(position=target)
        once.step()
        always.step()
    state = once.get_state().joint_pos
    initial = [world.joints[a.joint].initial for a in world.actuators]
    assert np.abs(state - initial).max() > 0.01, "the drives did not move at all"
    assert_same(read(once), read(always), "sent once against sent always")


def test_commands_of_envs_and_drives_are_apart(build):
    """`env_ids` and `actuators` address what they name and leave the rest."""
    engine = build(worlds.scene(), 3)
    engine.set_control(position=[[0.7]], env_ids=[1], actuators=[1])
    engine.step(1000)
    position = engine.get_state().joint_pos
    assert_close(position[:, 0], 0.2, 0.05, "the shoulders hold")
    assert abs(position[1, 1] - position[0, 1]) > 0.5
    assert np.array_equal(position[0], position[2])


def test_position_command_keeps_the_velocity_command(build):
    """Writing one kind of target leaves the other kinds."""
    world = worlds.slider(ControlMode.POSITION, 100.0, 20.0)
    engine, both = build(world), build(world)
    engine.set_control(velocity=0.5)
    engine.set_control(position=0.1)
    both.set_control(position=0.1, velocity=0.5)
    for e in (engine, both):
        e.step(20)
    assert_same(read(engine), read(both), "written apart against together")


@needs(C.CONTROL_VELOCITY)
def test_velocity_drive_reaches_its_speed(build):
    """A free velocity drive settles on its speed."""
    engine = build(worlds.slider(ControlMode.VELOCITY, 0.0, 50.0))
    engine.set_control(velocity=0.3)
    engine.step(1000)
    assert_close(engine.get_state().joint_vel, 0.3, tolerances.AT_REST, "speed")


@needs(C.CONTROL_EFFORT, C.DYNAMICS)
def test_effort_drive_exerts_its_effort(build):
    """An effort drive of 3 N gives 2 kg 1.5 m/s^2, and no other law is at work."""
    engine = build(worlds.slider(ControlMode.EFFORT, 100.0, 10.0))
    engine.set_control(position=5.0, velocity=5.0, effort=3.0)
    engine.step(500)
    assert_ratio(engine.get_state().joint_vel[0, 0], 1.5, tolerances.MOTION, "speed after 1 s")
    assert_ratio(engine.get_state().joint_effort[0, 0], 3.0, tolerances.MOTION, "effort reported")


@needs(C.DYNAMICS)
def test_position_drive_follows_its_law(build):
    """m q'' = kp (q* - q) - kd q': a step of 0.1 m against the exact solution, on the way and at rest."""
    m, kp, kd, step = 2.0, 200.0, 20.0, 0.1
    engine = build(worlds.slider(ControlMode.POSITION, kp, kd, mass=m))
    engine.set_control(position=step)
    omega, zeta = np.sqrt(kp / m), kd / (2 * np.sqrt(kp * m))
    damped = omega * np.sqrt(1 - zeta**2)
    for _ in range(75):
        engine.step(10)
        t = float(engine.get_state().time[0])
        decay = np.exp(-zeta * omega * t)
        exact = step * (1 - decay * (np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t)))
        assert_close(engine.get_state().joint_pos[0, 0], exact, tolerances.TRANSIENT, f"position at {t:.2f} s")
    assert_close(engine.get_state().joint_pos[0, 0], step, tolerances.AT_REST, "position at rest")


@needs(C.DYNAMICS)
def test_effort_feeds_forward(build):
    """A position drive adds the effort command: at rest q = q* + ff / kp."""
    engine = build(worlds.slider(ControlMode.POSITION, 100.0, 30.0))
    engine.set_control(position=0.1, effort=5.0)
    engine.step(1500)
    assert_close(engine.get_state().joint_pos, 0.15, tolerances.AT_REST, "position at rest")


@needs(C.DYNAMICS)
@pytest.mark.parametrize("dt", [0.002, 1 / 240])
def test_stiff_gains_are_stable(build, dt):
    """Gains of real robots (kp 4500, kd 450 on 0.2 kg) settle: the damping is taken implicitly."""
    engine = build(worlds.slider(ControlMode.POSITION, 4500.0, 450.0, mass=0.2, dt=dt))
    engine.set_control(position=0.3)
    engine.step(round(2.0 / dt))
    assert_close(engine.get_state().joint_pos, 0.3, tolerances.AT_REST, "position at rest")
    assert_close(engine.get_state().joint_vel, 0.0, tolerances.AT_REST, "speed at rest")


@needs(C.DYNAMICS, C.EFFORT_LIMITS)
def test_effort_is_clipped(build):
    """The whole law is clipped to the effort limit: 4 N on 2 kg give 2 m/s^2 however far the target is."""
    engine = build(worlds.slider(ControlMode.POSITION, 1000.0, 1.0, 4.0))
    engine.set_control(position=10.0)
    engine.step(500)
    assert_ratio(engine.get_state().joint_vel[0, 0], 2.0, tolerances.BLOCKED, "speed after 1 s")
    assert_ratio(engine.get_state().joint_effort[0, 0], 4.0, tolerances.BLOCKED, "effort reported")


@needs(C.DYNAMICS)
@pytest.mark.parametrize(("limit", "torque"), [(np.inf, 20.0), (5.0, 5.0)], ids=["unclipped", "clipped"])
def test_blocked_drive_exerts_its_torque(build, engine_class, limit, torque):
    """A drive pressed against a post exerts the commanded, clipped torque: reported, and on the post (0.4 m away)."""
    engine = build(worlds.blocked(100.0, 10.0, limit))
    engine.set_control(position=0.2)
    engine.step(1000)
    state = engine.get_state()
    wanted = min(torque, 100.0 * (0.2 - float(state.joint_pos[0, 0])))
    assert_close(state.joint_pos, 0.0, tolerances.LIMIT, "the blocked joint")
    assert_ratio(state.joint_effort[0, 0], wanted, tolerances.BLOCKED, "torque reported")
    force = -state.contact_force[0, 0]
    assert_ratio(force[1] * 0.4, wanted, tolerances.BLOCKED, "torque on the post")


@needs(C.JOINT_LIMITS)
def test_joint_limits_hold(build):
    """A drive that pulls past a limit leaves the joint at the limit."""
    engine = build(worlds.slider(ControlMode.POSITION, 200.0, 40.0, 50.0, lower=-0.1, upper=0.25))
    for target, limit in ((1.0, 0.25), (-1.0, -0.1)):
        engine.set_control(position=target)
        engine.step(1500)
        assert_close(engine.get_state().joint_pos, limit, tolerances.LIMIT, f"target {target:g}")


@needs(C.MIMIC_JOINTS)
def test_mimic_joints_follow(build):
    """A mimic joint is where its leader puts it, in motion and when the leader is written."""
    engine = build(worlds.gripper(), 2)
    engine.set_control(position=[[0.08], [0.02]])
    for steps in (30, 1000):
        engine.step(steps)
        left, right = engine.get_state().joint_pos.T
        assert_close(right, 0.5 * left + 0.01, tolerances.FOLLOWER, "follower")
    assert_close(left, np.array([0.08, 0.02]), tolerances.FOLLOWER, "leader at rest")
    engine.set_joint_state([[0.05]], joints=[0])
    assert_close(engine.get_state().joint_pos, np.array([0.05, 0.035]), tolerances.READ_BACK, "leader written")


@needs(C.CONTROL_POSITION, C.CONTROL_VELOCITY)
def test_modes_switch(build):
    """`set_control_mode` switches single drives in single envs while running."""
    engine = build(worlds.slider(ControlMode.POSITION, 200.0, 40.0), 2)
    engine.set_control(position=0.2, velocity=0.1)
    engine.set_control_mode("velocity", env_ids=[1])
    engine.step(1000)
    position, speed = engine.get_state().joint_pos[:, 0], engine.get_state().joint_vel[:, 0]
    assert_close(speed[1], 0.1, tolerances.AT_REST, "speed of the env in velocity mode")
    # a position drive with a velocity target of 0.1 m/s rests kd/kp x 0.1 beyond its target, if it has gains
    assert abs(speed[0]) < tolerances.AT_REST
    assert_close(position[0], 0.2, 0.1 * 40 / 200 + tolerances.AT_REST, "position of the env in position mode")
    engine.set_control_mode(ControlMode.POSITION, env_ids=[1])
    engine.set_control(position=0.0, velocity=0.0)
    engine.step(2500)
    assert_close(engine.get_state().joint_pos, 0.0, tolerances.AT_REST, "both back in position mode")


@needs(C.CONTROL_POSITION, C.CONTROL_VELOCITY, C.CONTROL_EFFORT, C.DYNAMICS)
def test_modes_mix_in_one_batch(build):
    """Each drive of each env has its own mode: position, velocity and effort side by side, feed-forward in all."""
    engine = build(worlds.sliders(3), 2)
    for drive, mode in enumerate(("position", "velocity", "effort")):
        engine.set_control_mode(mode, env_ids=[0], actuators=[drive])
        engine.set_control_mode(mode, env_ids=[1], actuators=[2 - drive])
    engine.set_control(position=0.1, velocity=0.0, effort=4.0)
    engine.step(1000)
    state = engine.get_state()
    for env, order in ((0, [0, 1, 2]), (1, [2, 1, 0])):
        place, speed = state.joint_pos[env, order], state.joint_vel[env, order]
        assert_close(place[0], 0.1 + 4.0 / 200.0, tolerances.AT_REST, f"env {env}: position, with feed-forward")
        assert_close(speed[1], 4.0 / 40.0, tolerances.AT_REST, f"env {env}: velocity, with feed-forward")
        assert_ratio(speed[2], 4.0 / 2.0 * 2.0, tolerances.MOTION, f"env {env}: effort, speed after 2 s")


@needs(C.DYNAMICS)
def test_the_explicit_law_is_of_the_state_before_the_step(build):
    """`actuation: explicit_pd`: m v' = m v + dt (kp (q* - q) - kd v), clipped, step by step."""
    world = worlds.actuated(worlds.slider(ControlMode.POSITION, 100.0, 20.0, 9.0), Actuation.EXPLICIT_PD)
    engine = build(world)
    engine.set_control(position=0.2)
    q = v = 0.0
    for _ in range(300):
        engine.step()
        v += 0.002 / 2.0 * float(np.clip(100.0 * (0.2 - q) - 20.0 * v, -9.0, 9.0))
        q += 0.002 * v
        assert_close(engine.get_state().joint_pos[0, 0], q, tolerances.READ_BACK, "position under the explicit law")


@needs(C.DYNAMICS)
def test_native_drives_do_what_their_modes_say(build):
    """`actuation: native`: each mode reaches what it is told, with feed-forward and within its effort limit."""
    world = worlds.actuated(worlds.sliders(3, limit=30.0), Actuation.NATIVE)
    engine = build(world)
    for drive, mode in enumerate(("position", "velocity", "effort")):
        engine.set_control_mode(mode, actuators=[drive])
    engine.set_control(position=0.1, velocity=0.0, effort=4.0)
    engine.step(1000)
    place, speed = engine.get_state().joint_pos[0], engine.get_state().joint_vel[0]
    assert_close(place[0], 0.1 + 4.0 / 200.0, tolerances.AT_REST, "position, with feed-forward")
    assert_close(speed[1], 4.0 / 40.0, tolerances.AT_REST, "velocity, with feed-forward")
    assert_ratio(speed[2], 4.0 / 2.0 * 2.0, tolerances.MOTION, "effort, speed after 2 s")
    engine.set_control(effort=100.0)
    before = float(engine.get_state().joint_vel[0, 2])
    engine.step(100)
    assert_ratio(engine.get_state().joint_vel[0, 2] - before, 30.0 / 2.0 * 0.2, tolerances.BLOCKED, "clipped to 30 N")


@needs(C.VELOCITY_LIMITS, C.DYNAMICS)
@pytest.mark.parametrize("enforced", [True, False], ids=["enforced", "ignored"])
def test_drives_keep_the_velocity_limit(build, enforced):
    """Where it is enforced, a position drive goes to a far target at the limit, and a velocity drive no faster."""
    world = worlds.sliders(2, velocity_limit=0.3)
    world = replace(world, physics=replace(world.physics, velocity_limits=enforced))
    engine = build(world)
    engine.set_control_mode("velocity", actuators=[1])
    engine.set_control(position=2.0, velocity=[[0.0, 0.8]])
    fastest = np.zeros(2)
    for _ in range(100):
        engine.step(5)
        fastest = np.maximum(fastest, engine.get_state().joint_vel[0])
    assert_close(fastest[1], 0.3 if enforced else 0.8, tolerances.AT_REST, "the velocity drive")
    if enforced:
        assert_close(engine.get_state().joint_vel[0, 0], 0.3, tolerances.AT_REST, "the position drive on its way")
        assert fastest[0] < 0.3 + tolerances.AT_REST
    else:
        assert fastest[0] > 1.0
    engine.step(4000)
    assert_close(engine.get_state().joint_pos[0, 0], 2.0, tolerances.AT_REST, "the position drive at its target")


# ---------------------------------------------------------------------- wrenches


@needs(C.WRENCHES)
def test_a_wrench_lasts_one_call(build):
    """A wrench acts in all substeps of the next `step` call, and is gone after it."""
    engine = build(worlds.spinning_ball())
    engine.apply_wrench([3.0, 0.0, -1.0, 0.0, 0.0, 0.0], [0])
    engine.step(100)
    speed = engine.get_state().body_twist[0, 0]
    assert_close(speed[:3], np.array([0.3, 0.0, -0.1]), tolerances.MOTION, "2 kg after 0.2 s under (3, 0, -1) N")
    engine.step(100)
    assert_close(engine.get_state().body_twist[0, 0], speed, tolerances.COASTING, "after a call without a wrench")


@needs(C.WRENCHES)
def test_a_torque_turns(build):
    """A torque in world axes turns the body by torque over inertia (2/5 m r^2 = 0.032)."""
    engine = build(worlds.spinning_ball())
    engine.set_body_state(pose=[0.0, 0.0, 0.0, 0.5**0.5, 0.0, 0.0, 0.5**0.5])
    engine.apply_wrench([0.0, 0.0, 0.0, 0.0, 0.064, 0.0], [0])
    engine.step(250)
    assert_close(
        engine.get_state().body_twist[0, 0, 3:], np.array([0.0, 1.0, 0.0]), tolerances.MOTION, "rate after 0.5 s"
    )


@needs(C.WRENCHES)
def test_a_force_acts_at_the_centre_of_mass(build):
    """A force does not turn a body whose centre of mass lies off its frame: it acts there, not at the origin."""
    engine = build(worlds.drifting((0.1, -0.05, 0.2)))
    engine.apply_wrench([4.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0])
    engine.step(250)
    assert_close(
        engine.get_state().body_twist[0, 0], np.array([1.0, 0, 0, 0, 0, 0]), tolerances.MOTION, "twist after 0.5 s"
    )


@needs(C.WRENCHES)
def test_wrenches_add_up_in_their_envs(build):
    """Wrenches on a body before one step add; other envs and bodies feel nothing."""
    engine = build(worlds.drifting(count=2), 2)
    for _ in range(2):
        engine.apply_wrench([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [1], env_ids=[1])
    engine.step(500)
    speed = engine.get_state().body_twist[..., 0]
    assert_close(speed, np.array([[0.0, 0.0], [0.0, 1.0]]), tolerances.MOTION, "speeds after 1 s")


@needs(C.GRAVITY_COMPENSATION, C.DYNAMICS)
def test_gravity_compensation(build):
    """A gravity-compensated link hangs without effort; its neighbour in another world falls."""
    held = build(worlds.slider(gravity=(0.0, 0.0, -9.81), axis=(0.0, 0.0, 1.0), compensated=True))
    falls = build(worlds.slider(gravity=(0.0, 0.0, -9.81), axis=(0.0, 0.0, 1.0)))
    for engine in (held, falls):
        engine.step(250)
    assert_close(held.get_state().joint_pos, 0.0, tolerances.AT_REST, "the compensated carriage")
    assert_ratio(falls.get_state().joint_vel[0, 0], -9.81 * 0.5, tolerances.MOTION, "the other one")


def test_send_action_by_name(build):
    """`send_action` takes targets by joint name, leaves drives that are not named, and steps."""
    world = worlds.scene()
    named, indexed = build(world, 2), build(world, 2)
    assert named.list_robots() == ["arm"]
    assert named.robot_joint_names() == ["shoulder", "elbow"]
    named.send_action({"elbow": 0.3}, n_substeps=20)
    indexed.set_control(position=0.3, actuators=[1])
    indexed.step(20)
    assert_same(read(named), read(indexed), "by name against by index")
    observation = named.get_observation(skip_images=True)
    assert np.array_equal(observation["joint_pos"], named.get_state().joint_pos)
    assert observation["tool_pose"].shape == (2, 7)

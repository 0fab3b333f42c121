"""The computed drive law, free and blocked, against Bullet's own dynamics and against MuJoCo."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.engine.factory import create_simulation
from anysim.math import pose as P
from anysim.model.world import Box, ControlMode, JointType
from anysim.testing import tolerances
from anysim.testing.sketch import Sketch, inertial
from anysim_mechanics import articulation as K
from anysim_pybullet.bullet import bullet

Z, EFFORT, REVOLUTE = (0.0, 0.0, 1.0), ControlMode.EFFORT, JointType.REVOLUTE


def _dynamics(engine, tree_number=0):
    """Mass matrix, bias and known forces of an articulation now, by the kernel."""
    envs = engine._envs
    tree, state = envs.plan.trees[tree_number], engine.get_state()
    root = np.concatenate([state.body_pose[0, tree.bodies[0]], state.body_twist[0, tree.bodies[0]]])
    motion = np.stack([state.joint_pos[0, tree.joints], state.joint_vel[0, tree.joints]])
    mass, bias, known = np.empty((tree.size, tree.size)), np.empty(tree.size), np.empty(tree.size)
    K.dynamics(
        tree.joint_ints,
        tree.joint_floats,
        envs.laws.bodies[0, tree.bodies],
        np.zeros((len(tree.bodies), 6)),
        envs.laws.gravity[0],
        root,
        motion,
        tree.first,
        mass,
        bias,
        known,
    )
    return mass, bias, known


def test_the_dynamics_are_bullets(build, own):
    """Mass matrix and bias forces equal Bullet's own, with skew axes, anchors and tensors, on a turned base."""
    engine = build(own.skew_arm())
    engine.set_joint_state([0.7, -0.1, 1.1], [1.3, -0.8, 2.0])
    mass, bias, known = _dynamics(engine)
    env, p = engine._envs.clients[0], bullet()
    q, v = engine.get_state().joint_pos[0].tolist(), engine.get_state().joint_vel[0].tolist()
    theirs = np.array(p.calculateMassMatrix(env.root_ids[0], q, physicsClientId=env.id))
    assert np.allclose(mass, theirs, rtol=1e-9, atol=1e-12)
    assert np.allclose(bias, p.calculateInverseDynamics(env.root_ids[0], q, v, [0.0] * 3, physicsClientId=env.id))
    assert not known.any()


@pytest.mark.parametrize("free", [False, True], ids=["fixed-base", "free-base"])
def test_the_momentum_balance_closes(build, own, free):
    """In free motion the last step explains itself: the outer force that the law infers is nothing."""
    engine = build(own.skew_arm(free=free))
    engine.set_control(position=[1.0, 0.2, 0.3])
    engine.step(60)
    laws, tree = engine._envs.laws, engine._envs.plan.trees[0]
    memory = laws.remembered(0, 0)
    n = tree.size
    before, applied, mass = memory[1 : 1 + n].copy(), memory[1 + n : 1 + 2 * n].copy(), memory[1 + 2 * n :].copy()
    state = engine.get_state()
    root = state.body_twist[0, 0] if free else np.zeros(0)
    speed = np.concatenate([root, state.joint_vel[0]])
    outer = mass.reshape(n, n) @ (speed - before) / engine.world.physics.dt + applied
    assert np.abs(speed - before).max() > 1e-3
    # Bullet turns a free base after it adds forces up, so that its balance closes to first order in the step
    assert np.abs(outer).max() < (0.2 if free else 1e-8)


@pytest.mark.parametrize("free", [False, True], ids=["fixed-base", "free-base"])
@pytest.mark.parametrize("joint", [{}, {"armature": 0.1, "damping": 0.5}], ids=["plain", "armature-damping"])
def test_mujoco_moves_alike(build, own, free, joint):
    """The same commands give the same motion in both engines: 5e-3 on the way, 1e-3 at rest.

    At 1 ms: both are first-order in the step, and with 2 ms this arm's last link tells them apart by 0.011 rad.
    """
    pytest.importorskip("mujoco", reason="the package mujoco is not installed")
    gravity = (0.0, 0.0, 0.0) if free else (0.0, 0.0, -9.81)
    world = own.skew_arm(free=free, gravity=gravity, **joint)
    world = replace(world, physics=replace(world.physics, dt=0.001))
    ours, theirs = build(world), build(world, name="mujoco")
    for engine in (ours, theirs):
        engine.set_control(position=[0.8, 0.15, 0.2])
    worst = 0.0
    for _ in range(100):
        for engine in (ours, theirs):
            engine.step(20)
        worst = max(worst, np.abs(ours.get_state().joint_pos - theirs.get_state().joint_pos).max())
    assert worst < tolerances.TRANSIENT
    gap = np.abs(ours.get_state().joint_pos - theirs.get_state().joint_pos).max()
    assert gap < tolerances.AT_REST
    wanted = theirs.get_state().body_pose[0]
    assert np.abs(ours.get_state().body_pose[0, :, :3] - wanted[:, :3]).max() < 5 * tolerances.AT_REST
    assert P.angle_between(ours.get_state().body_pose[0, :, 3:], wanted[:, 3:]).max() < 5 * tolerances.AT_REST


@pytest.mark.parametrize(
    ("mass", "armature", "kp", "kd", "steps"),
    [(1.0, 0.01, 100.0, 10.0, 100), (0.015, 0.1, 1000.0, 300.0, 300), (0.015, 0.0, 1000.0, 300.0, 300)],
)
def test_a_blocked_drive_exerts_its_force(build, own, mass, armature, kp, kd, steps):
    """Pressed against a wall a drive exerts kp times its error, on the wall too; light parts with stiff gains later."""
    engine = build(own.pressed(mass, armature, kp, kd))
    engine.set_control(position=0.04)
    engine.step(60 + steps)
    state = engine.get_state()
    wanted = kp * (0.04 - float(state.joint_pos[0, 0]))
    assert state.joint_effort[0, 0] == pytest.approx(wanted, rel=tolerances.BLOCKED)
    assert -state.contact_force[0, 0, 0] == pytest.approx(wanted, rel=tolerances.BLOCKED)


def test_without_the_outer_force_a_blocked_drive_is_weak(build, own):
    """What the memory of the last step is for: forgotten in every step, a finger gets 7 % of its command."""
    engine = build(own.pressed(0.015, 0.1, 1000.0, 300.0))
    engine.set_control(position=0.04)
    for _ in range(360):
        engine._envs.laws.forget(0)
        engine.step()
    assert engine.get_state().joint_effort[0, 0] < 0.3 * 30.0


def test_a_compensated_free_base_floats(build, own):
    """Counter forces hold every link of a floating robot, and a free body by itself."""
    world = own.skew_arm(free=True)
    world = replace(world, bodies=tuple(replace(b, gravity_compensation=True) for b in world.bodies))
    engine = build(world)
    engine.step(500)
    pose = engine.get_state().body_pose[0]
    assert np.abs(pose[:, :3] - world.initial_body_pose[:, :3]).max() < 1e-3


def test_a_wrench_on_a_link_acts_at_its_centre_of_mass(build, own):
    """A force on a link of an arm accelerates its joints as MuJoCo's do."""
    pytest.importorskip("mujoco", reason="the package mujoco is not installed")
    world = own.skew_arm(gravity=(0.0, 0.0, 0.0))
    ours, theirs = build(world), build(world, name="mujoco")
    for engine in (ours, theirs):
        engine.set_control_mode("effort")
        engine.apply_wrench([1.0, -2.0, 0.5, 0.1, 0.2, -0.1], [3])
        engine.step(50)
    assert np.abs(theirs.get_state().joint_pos - world_initial(world)).max() > 0.01
    assert np.allclose(ours.get_state().joint_pos, theirs.get_state().joint_pos, atol=1e-3)


def world_initial(world):
    return np.array([j.initial for j in world.joints])


def test_worlds_without_drives_are_left_to_bullet():
    """An articulation without anything to compute costs no computation."""
    from anysim.testing import worlds

    with create_simulation("pybullet").create_world(worlds.double_pendulum()) as engine:
        assert engine._envs.laws.needs == [False]


@pytest.mark.parametrize("kind", list(JointType))
def test_dry_friction_acts_on_the_armature_too(build, kind):
    """2 N m hold against 1.9 and take 2 off 3 of a link with an armature hundreds of times its inertia, from the start.

    It stops what coasts, and ends where it is taken away.
    """
    s = Sketch("dry", gravity=(0.0, 0.0, 0.0))
    part = inertial(Box((0.01, 0.01, 0.01)), 0.5)
    link = s.link("link", s.robot("dry"), kind, Z, part, friction=2.0, armature=0.08 if kind is REVOLUTE else 200.0)
    s.drive(link, EFFORT)
    engine = build(s.world(), 4)
    size = 200.5 if kind is not REVOLUTE else 0.08 + part.inertia[2]
    engine.set_control(effort=[[1.9], [3.0], [-3.0], [-1.9]])
    engine.step(50)
    time = 50 * engine.world.physics.dt
    speed = np.array([0.0, 1.0, -1.0, 0.0]) * time / size
    assert engine.get_state().joint_vel[:, 0] == pytest.approx(speed, rel=1e-3, abs=1e-6 / size)
    engine.set_control(effort=[[0.0]] * 4)
    engine.step(60)
    assert np.abs(engine.get_state().joint_vel[:, 0]).max() < 1e-6 / size
    engine.set_parameters("joint.friction", 0.0)
    engine.set_control(effort=[[1.9], [3.0], [-3.0], [-1.9]])
    engine.step(50)
    wanted = np.array([1.9, 3.0, -3.0, -1.9]) * time / size
    assert engine.get_state().joint_vel[:, 0] == pytest.approx(wanted, rel=1e-3)

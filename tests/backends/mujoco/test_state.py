"""States as read, which are true: kinematics, velocities, forces, faults."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics


def test_kinematics_are_the_reference_ones(worlds, make, shake):
    """Anchors, skew axes and turned frames, while moving: 1e-12 against the engine-free kinematics."""
    world = worlds.scene()
    engine = make(world, 4)
    shake(engine)
    state = engine.get_state()
    assert np.abs(forward_kinematics(world, state.body_pose, state.joint_pos) - state.body_pose).max() < 1e-12


def test_twists_are_mujocos_object_velocities(worlds, make, shake):
    """At the frame's origin, in world axes, against mj_objectVelocity."""
    engine = make(worlds.scene(), 2)
    shake(engine)
    twist, velocity = engine.get_state().body_twist, np.zeros(6)
    model, data = engine._sims.queries.env(1)
    mujoco.mj_forward(model, data)
    for body, number in enumerate(engine._sims.layout.bodies):
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, number, velocity, 0)
        assert np.allclose(twist[1, body], velocity[[3, 4, 5, 0, 1, 2]], atol=1e-12)


def test_twists_are_what_the_poses_do(worlds, make):
    """Differences over one small step, at whose end a semi-implicit velocity belongs."""
    world = worlds.scene()
    engine = make(replace(world, physics=replace(world.physics, dt=1e-5, control_dt=1e-5)))
    engine.set_joint_state(velocity=[[1.0, -2.0]])
    engine.set_body_state(twist=[[[0.3, -0.2, 0.1, 1.0, 2.0, -3.0], [0.0, 0.1, 0.2, -1.0, 0.5, 0.3]]])
    engine.step(5)
    before = engine.get_state().body_pose
    engine.step()
    after, twist = engine.get_state().body_pose, engine.get_state().body_twist
    assert np.allclose((after - before)[..., :3] / 1e-5, twist[..., :3], atol=1e-3)
    rotation = P.rotation_vector(P.multiply(after[..., 3:], P.conjugate(before[..., 3:])))
    assert np.allclose(rotation / 1e-5, twist[..., 3:], atol=1e-3)


def test_written_twists_are_read_back(worlds, make):
    """Including the angular rate of a turned body, which MuJoCo keeps in other axes."""
    engine = make(worlds.scene(), 2)
    pose = np.array([[[0.0, 0.0, 1.0, 0.5, 0.5, -0.5, 0.5], [1.0, 0.0, 2.0, 0.0, 0.6, 0.0, 0.8]]] * 2)
    twist = np.arange(24.0).reshape(2, 2, 6) / 10
    engine.set_body_state(pose, twist)
    state = engine.get_state()
    assert np.allclose(state.body_pose[:, :2], pose, atol=1e-15)
    assert np.allclose(state.body_twist[:, :2], twist, atol=1e-12)


def test_a_ball_falls(worlds, make):
    """Semi-implicit: v = g t exactly, the height one half step lower."""
    engine = make(worlds.ball(10.0))
    engine.step(500)
    state = engine.get_state()
    assert state.time[0] == pytest.approx(1.0)
    assert state.body_twist[0, 0, 2] == pytest.approx(-9.81, rel=1e-12)
    assert state.body_pose[0, 0, 2] == pytest.approx(10.0 - 9.81 * 0.5 * (1.0 + 0.002), rel=1e-9)


def test_contact_forces_point_at_the_body_and_equal_its_weight(worlds, make):
    """Net force on the body, upwards, in both sensors."""
    engine = make(worlds.ball(0.05, mass=0.5), 2)
    engine.step(1500)
    force = engine.get_state().contact_force
    assert np.allclose(force[:, :, 2], 0.5 * 9.81, rtol=1e-6)
    assert np.abs(force[:, :, :2]).max() < 1e-6


def test_efforts_belong_to_the_last_substep(worlds, make):
    """Writing a state does not change them, a reset forgets them."""
    engine = make(worlds.scene(), 2)
    engine.step(3)
    effort = engine.get_state().joint_effort.copy()
    assert np.abs(effort).min() > 0
    engine.set_joint_state([[1.0, 1.0]], env_ids=[0])
    assert engine.get_state().body_pose is not None
    assert np.array_equal(engine.get_state().joint_effort, effort)
    engine.reset([0])
    assert np.array_equal(engine.get_state().joint_effort, [[0.0, 0.0], effort[1]])


def test_reading_changes_nothing(worlds, make, shake):
    """States that are read after every write lead to the same bits as states that are not."""
    reader, other = make(worlds.scene(), 2), make(worlds.scene(), 2)
    for engine in (reader, other):
        engine.step(50)
        engine.set_joint_state([[0.5, 0.5]], env_ids=[1])
        if engine is reader:
            _ = engine.get_state().body_twist, engine.contacts(), engine.get_state().contact_force
            engine.raycast([[[0.0, 0.0, 5.0]]] * 2, [[[0.0, 0.0, -1.0]]] * 2)
    assert all(np.array_equal(a, b) for a, b in zip(shake(reader), shake(other), strict=True))


@pytest.mark.parametrize("twist", [1e12, 1e9])
def test_one_env_may_diverge(worlds, make, twist):
    """A fault is the env's alone, stays until its reset, and the others' bits do not know of it."""
    engine, healthy = make(worlds.scene(), 3), make(worlds.scene(), 3)
    engine.set_body_state(twist=np.full((1, 2, 6), twist), env_ids=[1])
    for _ in range(3):
        engine.step(50)
        healthy.step(50)
    state, wanted = engine.get_state(), healthy.get_state()
    assert state.fault.tolist() == [False, True, False]
    assert not wanted.fault.any()
    for name in ("body_pose", "body_twist", "joint_pos", "joint_effort"):
        assert np.array_equal(getattr(state, name)[[0, 2]], getattr(wanted, name)[[0, 2]])
    engine.reset([1])
    assert not engine.get_state().fault.any()
    engine.step(150)
    assert np.array_equal(engine.get_state().body_pose[1], wanted.body_pose[0])


def test_a_finite_but_huge_velocity_is_seen_before_it_is_nan(worlds, make):
    """MuJoCo's own limits count: the env is a fault although every number in it may still be finite."""
    engine = make(worlds.ball())
    engine.set_body_state(twist=[[[0.0, 0.0, 1e11, 0.0, 0.0, 0.0]]])
    engine.step()
    assert engine.get_state().fault[0]


def test_too_little_memory_for_contacts_is_a_fault(worlds, make):
    """Contacts that are dropped in silence would be a wrong answer."""
    world = worlds.scene()
    from anysim.model.world import Body, BodyKind, Box, Geom

    for i in range(30):
        half = (0.2, 0.2, 0.05)
        body = Body(
            f"b{i}", BodyKind.FREE, position=(3.0, 0.0, 0.05 + 0.099 * i), inertial=worlds.box_inertial(1.0, half)
        )
        world = worlds.with_body(world, body, Geom(f"b{i}", 0, Box(half)))
    starved, fed = make(world, memory_mb=1, jacobian="dense"), make(world)
    starved.step(5)
    fed.step(5)
    assert not fed.get_state().fault.any()
    assert starved.get_state().fault.all()

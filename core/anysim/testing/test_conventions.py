"""Meaning of the numbers: shapes, types, order, frames, axes."""

import numpy as np
import pytest

from anysim.conventions import IDENTITY_QUATERNION
from anysim.engine.capability import Capability as C
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.testing import tolerances, worlds
from anysim.testing.compare import assert_close, quaternions_apart, read
from anysim.testing.fixtures import needs

COM = (0.1, -0.05, 0.2)
QUARTER = 0.5**0.5


@pytest.mark.parametrize("num_envs", [1, 3])
def test_shapes_and_types(build, num_envs):
    """Arrays lead with `num_envs`, are C-contiguous, float64 (fault: bool), and finite."""
    world = worlds.scene()
    engine = build(world, num_envs)
    engine.step(3)
    state, bodies, joints = engine.get_state(), len(world.bodies), len(world.joints)
    shapes = {
        "body_pose": (bodies, 7), "body_twist": (bodies, 6), "joint_pos": (joints,), "joint_vel": (joints,),
        "joint_effort": (joints,), "contact_force": (0, 3), "fault": (), "time": (),
    }  # fmt: skip
    for name, shape in shapes.items():
        array = getattr(state, name)
        assert array.shape == (num_envs, *shape), name
        assert array.dtype == (bool if name == "fault" else np.float64), name
        assert array.flags.c_contiguous, name
        assert np.isfinite(array).all(), name


@needs(C.CONTACT_SENSORS)
def test_contact_sensor_shape(build):
    """`contact_force` is (N, S, 3) float64, in the order of the World's sensors."""
    force = build(worlds.scene(sensor=True), 2).get_state().contact_force
    assert force.shape == (2, 1, 3)
    assert force.dtype == np.float64


def test_quaternions_are_xyzw(build):
    """Quaternions put the scalar last, written and read, and turn the right way."""
    engine = build(worlds.drifting())
    assert_close(
        engine.get_state().body_pose[0, 0, 3:], np.array(IDENTITY_QUATERNION), tolerances.READ_BACK, "identity"
    )
    wanted = np.array([0.5, 0.1, -0.2, 0.0])
    wanted[3] = np.sqrt(1 - (wanted**2).sum())
    engine.set_body_state(pose=[1.0, 2.0, 3.0, *wanted])
    got = engine.get_state().body_pose[0, 0]
    assert_close(got[:3], np.array([1.0, 2.0, 3.0]), tolerances.READ_BACK, "position read back")
    assert quaternions_apart(got[3:], wanted) <= tolerances.READ_BACK
    # a link's pose is computed by the engine, not read back: a quarter turn about the world's y
    bob = build(worlds.pendulum())
    bob.set_joint_state(np.pi / 2)
    pose = bob.get_state().body_pose[0, 1]
    rest = np.array([QUARTER, 0.0, 0.0, QUARTER])
    turned = P.multiply(np.array([0.0, QUARTER, 0.0, QUARTER]), rest)
    assert quaternions_apart(pose[3:], turned) <= tolerances.KINEMATICS
    assert_close(pose[:3], np.array([-0.5, 0.0, 2.0]), tolerances.KINEMATICS, "the bob, turned about +y, swings to -x")


def test_quaternions_stay_unit(build):
    """Quaternions keep unit length while bodies turn."""
    engine = build(worlds.drifting())
    engine.set_body_state(twist=[0.0, 0.0, 0.0, 5.0, 3.0, -4.0])
    engine.step(500)
    length = np.linalg.norm(engine.get_state().body_pose[0, 0, 3:])
    assert_close(length, 1.0, tolerances.READ_BACK, "length of a quaternion")


def test_poses_are_those_of_frames(build):
    """A pose is that of the body's frame, wherever its centre of mass lies."""
    engine = build(worlds.drifting(COM))
    assert_close(
        engine.get_state().body_pose[0, 0, :3], np.array([0.0, 0.0, 1.0]), tolerances.READ_BACK, "initial position"
    )
    pose = np.array([1.0, 2.0, 3.0, 0.0, QUARTER, 0.0, QUARTER])
    engine.set_body_state(pose=pose)
    assert_close(engine.get_state().body_pose[0, 0], pose, tolerances.READ_BACK, "pose read back")


def test_linear_velocity_is_that_of_the_frame_origin(build):
    """A body's linear velocity is its frame origin's, not its centre of mass's: read back, and by its motion."""
    engine = build(worlds.drifting(COM, dt=1e-4))
    twist = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 2.0])
    engine.set_body_state(pose=[0.0, 0.0, 1.0, 0.0, 0.0, QUARTER, QUARTER], twist=twist)
    assert_close(engine.get_state().body_twist[0, 0], twist, tolerances.READ_BACK, "twist read back")
    before = engine.get_state().body_pose[0, 0, :3]
    engine.step()
    rate = (engine.get_state().body_pose[0, 0, :3] - before) / 1e-4
    assert_close(rate, twist[:3], tolerances.DIFFERENCE, "velocity of the origin by its motion")


def test_angular_velocity_is_in_world_axes(build):
    """A body's angular velocity is in world axes, whatever its orientation."""
    engine = build(worlds.drifting(dt=1e-3))
    start = np.array([0.0, QUARTER, 0.0, QUARTER])
    twist = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.5])
    engine.set_body_state(pose=[0.0, 0.0, 1.0, *start], twist=twist)
    assert_close(engine.get_state().body_twist[0, 0], twist, tolerances.READ_BACK, "twist read back")
    engine.step(10)
    end = engine.get_state().body_pose[0, 0, 3:]
    turned = P.rotation_vector(P.multiply(end, P.conjugate(start)))
    assert_close(turned / 0.01, twist[3:], tolerances.DIFFERENCE, "rate by its motion")


def test_bodies_and_joints_are_in_the_worlds_order(build):
    """Joints and bodies come in the World's order, depth first, whatever the engine's own is."""
    world = worlds.tree()
    engine = build(world, 2)
    wanted = np.array([[0.1, 0.2, 0.3, 0.4], [-0.4, -0.3, -0.2, -0.1]])
    engine.set_joint_state(wanted, wanted * 2)
    state = engine.get_state()
    assert_close(state.joint_pos, wanted, tolerances.READ_BACK, "joint positions, in order")
    assert_close(state.joint_vel, wanted * 2, tolerances.READ_BACK, "joint velocities, in order")
    assert_close(state.body_pose[:, 0, 0], 3.0, tolerances.READ_BACK, "the first body is 'before'")
    assert_close(state.body_pose[:, -1, 0], -3.0, tolerances.READ_BACK, "the last body is 'after'")
    engine.set_joint_state([[0.25], [0.35]], joints=[2])
    wanted[:, 2] = [0.25, 0.35]
    assert_close(engine.get_state().joint_pos, wanted, tolerances.READ_BACK, "one joint written by its index")


def test_links_are_where_kinematics_puts_them(build):
    """Link frames follow the World's frames, anchors, axes and joint positions."""
    for world in (worlds.tree(), worlds.pendulum(), worlds.double_pendulum()):
        engine = build(world, 4)
        rng = np.random.default_rng(4)
        positions = rng.uniform(-0.4, 0.4, (4, len(world.joints)))
        engine.set_joint_state(positions)
        got = engine.get_state().body_pose
        wanted = forward_kinematics(world, got, positions)
        assert_close(got[..., :3], wanted[..., :3], tolerances.KINEMATICS, f"positions in {world.name}")
        assert quaternions_apart(got[..., 3:], wanted[..., 3:]) <= tolerances.KINEMATICS, world.name


def test_twists_of_links_are_rates_of_their_poses(build):
    """A link's twist is the rate of its frame: the difference quotient of kinematics says the same."""
    for world in (worlds.tree(), worlds.pendulum(), worlds.double_pendulum()):
        engine = build(world)
        rng = np.random.default_rng(5)
        position, velocity = rng.uniform(-0.4, 0.4, (2, 1, len(world.joints)))
        engine.set_joint_state(position, velocity)
        state = engine.get_state()
        small = 1e-6
        ahead = forward_kinematics(world, state.body_pose, position + small * velocity)[0]
        back = forward_kinematics(world, state.body_pose, position - small * velocity)[0]
        linear = (ahead[:, :3] - back[:, :3]) / (2 * small)
        angular = P.rotation_vector(P.multiply(ahead[:, 3:], P.conjugate(back[:, 3:]))) / (2 * small)
        got = state.body_twist[0]
        assert_close(got[:, :3], linear, 10 * tolerances.READ_BACK, f"linear velocities in {world.name}")
        assert_close(got[:, 3:], angular, 10 * tolerances.READ_BACK, f"angular velocities in {world.name}")


def test_writes_are_seen_at_once(build):
    """What was written is read without a step in between, links included; unwritten things stay."""
    engine = build(worlds.scene())
    before = read(engine)
    engine.set_joint_state(position=[[0.5]], joints=[1])
    after = read(engine)
    assert_close(after["joint_pos"][0], np.array([before["joint_pos"][0, 0], 0.5]), tolerances.READ_BACK, "joints")
    tool = engine.index.body("arm.elbow")
    assert abs(after["body_pose"][0, tool, 4] - before["body_pose"][0, tool, 4]) > 0.1
    box = engine.index.body("box")
    assert np.array_equal(after["body_pose"][0, box], before["body_pose"][0, box])
    assert np.array_equal(after["time"], before["time"])


def test_poses_and_twists_are_written_apart(build):
    """Writing a pose keeps the twist, writing a twist keeps the pose, bit for bit."""
    engine = build(worlds.drifting(COM, count=2), 2)
    engine.set_body_state(twist=[0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    before = read(engine)
    engine.set_body_state(twist=np.zeros(6), env_ids=[1], bodies=[0])
    after = read(engine)
    assert np.array_equal(after["body_pose"], before["body_pose"])
    assert np.array_equal(after["body_twist"][0], before["body_twist"][0])
    engine.set_body_state(pose=[9.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], env_ids=[0], bodies=[1])
    end = engine.get_state()
    assert_close(
        end.body_twist[0, 1], before["body_twist"][0, 1], tolerances.READ_BACK, "twist after a pose was written"
    )
    assert np.array_equal(end.body_pose[0, 0], before["body_pose"][0, 0])


def test_writing_back_what_was_read_changes_nothing(build):
    """Poses and joint positions that were read and written back leave the trajectory as it was."""
    world = worlds.drifting(COM)
    one, other = build(world), build(world)
    for engine in (one, other):
        engine.set_body_state(twist=[0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
        engine.step(50)
    state = one.get_state()
    one.set_body_state(pose=state.body_pose, twist=state.body_twist)
    for engine in (one, other):
        engine.step(50)
    assert_close(one.get_state().body_pose, other.get_state().body_pose, tolerances.READ_BACK, "50 steps later")

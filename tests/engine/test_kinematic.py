"""The kinematic engine beyond the contract: how its drives and joints move."""

import numpy as np
import pytest

from anysim.engine.capability import Capability
from anysim.model.world import ControlMode
from anysim.testing import worlds
from anysim.testing.kinematic import NullEngine


def test_an_unlimited_position_drive_arrives_in_one_step_on_the_targets_own_bits():
    engine = NullEngine().create_world(worlds.slider(ControlMode.POSITION), 2)
    targets = np.array([[0.1 + 0.2], [-1 / 3]])
    engine.set_control(position=targets)
    engine.step()
    assert np.array_equal(engine.get_state().joint_pos, targets)
    engine.step()
    assert np.array_equal(engine.get_state().joint_vel, np.zeros((2, 1)))


def test_a_position_drive_keeps_to_the_velocity_limit():
    engine = NullEngine().create_world(worlds.slider(ControlMode.POSITION, velocity_limit=0.5))
    engine.set_control(position=0.3)
    engine.step(100)
    state = engine.get_state()
    assert state.joint_pos[0, 0] == pytest.approx(0.1)
    assert state.joint_vel[0, 0] == pytest.approx(0.5)
    engine.step(250)
    assert engine.get_state().joint_pos[0, 0] == 0.3


def test_a_velocity_drive_has_its_speed_at_once_and_keeps_to_the_limit():
    engine = NullEngine().create_world(worlds.slider(ControlMode.VELOCITY, velocity_limit=0.5))
    engine.set_control(velocity=2.0)
    engine.step(100)
    assert engine.get_state().joint_vel[0, 0] == 0.5
    assert engine.get_state().joint_pos[0, 0] == pytest.approx(0.1)


def test_an_effort_drive_does_nothing_and_a_joint_coasts():
    engine = NullEngine().create_world(worlds.slider(ControlMode.EFFORT))
    engine.set_control(effort=100.0)
    engine.set_joint_state(velocity=0.25)
    engine.step(400)
    assert engine.get_state().joint_vel[0, 0] == 0.25
    assert engine.get_state().joint_pos[0, 0] == pytest.approx(0.2)


def test_a_coasting_joint_stops_at_its_limit():
    engine = NullEngine().create_world(worlds.slider(drive=False, lower=-0.1, upper=0.1))
    engine.set_joint_state(velocity=1.0)
    engine.step(200)
    assert engine.get_state().joint_pos[0, 0] == 0.1
    assert engine.get_state().joint_vel[0, 0] == 0.0


def test_nothing_falls_and_nothing_touches():
    engine = NullEngine().create_world(worlds.scene(sensor=True))
    before = engine.get_state().body_pose
    engine.step(100)
    assert np.array_equal(engine.get_state().body_pose, before)
    assert not engine.get_state().contact_force.any()


def test_it_says_what_it_ignores():
    engine = NullEngine().create_world(worlds.scene(sensor=True))
    listed = {need.capability for need in engine.approximations}
    assert {Capability.CONTACTS_STATIC, Capability.CONTACT_SENSORS, Capability.EFFORT_LIMITS} <= listed
    assert Capability.DYNAMICS not in NullEngine.capabilities


def test_a_free_body_turns_at_its_rate():
    engine = NullEngine().create_world(worlds.drifting())
    engine.set_body_state(twist=[0, 0, 0, 0, 0, np.pi / 2])
    engine.step(500)
    assert np.allclose(engine.get_state().body_pose[0, 0, 3:], [0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4)])


def test_a_camera_view_keeps_poses_of_its_own():
    engine = NullEngine().create_world(worlds.scene())
    given = engine.get_state().body_pose.copy()
    view = engine.camera_view("default", body_pose=given)
    kept = view.body_pose.copy()
    given[:] = np.nan
    assert np.array_equal(view.body_pose, kept)

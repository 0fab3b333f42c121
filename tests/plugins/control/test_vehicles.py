"""Controllers of vehicles: what they ask of the wheels, limits, and what they refuse."""

from typing import Any

import numpy as np
import pytest

from anysim.api import compile_world, load
from anysim.controllers.base import ChannelView
from anysim.controllers.robot import ControlledRobot
from anysim.errors import TaskError
from anysim.model.world import ControlMode
from anysim.testing.kinematic import NullEngine
from anysim_control.vehicles import wheels as W
from anysim_control.vehicles.ackermann import AckermannDrive
from anysim_control.vehicles.differential import DifferentialDrive
from anysim_control.vehicles.holonomic import HolonomicDrive
from anysim_control.vehicles.parts import Ramp


def made(robot: str, kind: Any, num_envs: int = 1, **params: Any) -> Any:
    """A controller of a catalogue robot that stands at its home."""
    world = compile_world(load({"world": {"name": "w", "terrain": "plane", "robots": {"r": {"robot": robot}}}}))
    engine = NullEngine()
    engine.create_world(world, num_envs)
    controlled = ControlledRobot(world, "r")
    controlled.see(engine.get_state())
    controller = kind(ChannelView.of(world, world.robots[0].channels["base"], controlled), num_envs, **params)
    controller.reset(np.arange(num_envs), np.zeros((num_envs, len(controller.channel))))
    return controller


def test_differential_wheels_and_bounds() -> None:
    drive = made("differential_base", DifferentialDrive, acceleration=1e3, turn_acceleration=1e3)
    assert drive.mode == (ControlMode.VELOCITY, ControlMode.VELOCITY)
    assert np.allclose(drive.high, [1.5, 2 * 1.5 / 0.42]), "those of the wheels"
    command = drive.apply(np.array([[0.5, 1.0]]), None)
    assert np.allclose(command.velocity, W.differential_wheels(np.array([0.5]), np.array([1.0]), 0.1, 0.42))


def test_too_fast_wheels_keep_the_curvature() -> None:
    drive = made("differential_base", DifferentialDrive, acceleration=1e3, turn_acceleration=1e3)
    wheels = drive.apply(np.array([[1.5, 3.0]]), None).velocity
    assert np.abs(wheels).max() == pytest.approx(15.0)
    speed, omega = W.differential_twist(wheels, 0.1, 0.42)
    assert omega[0] / speed[0] == pytest.approx(2.0)


def test_acceleration_is_limited_and_what_is_reached_is_exact() -> None:
    drive = made("differential_base", DifferentialDrive, 2, acceleration=1.0, turn_acceleration=3.0)
    action = np.array([[0.05, 0.0], [0.05, 0.3]])
    steps = [W.differential_twist(drive.apply(action, None).velocity, 0.1, 0.42) for _ in range(6)]
    speeds, turns = np.array([s for s, _ in steps]), np.array([t for _, t in steps])
    assert np.allclose(speeds[:, 0], [0.02, 0.04, 0.05, 0.05, 0.05, 0.05])
    assert np.allclose(turns[:, 1] * 0.05, speeds[:, 1] * 0.3), "the curvature holds on the way"
    assert np.allclose(turns[:, 1], [0.06, 0.12, 0.18, 0.24, 0.3, 0.3])


def test_a_restored_controller_goes_on_alike() -> None:
    drive = made("holonomic_base", HolonomicDrive, 2)
    action = np.array([[0.5, 0.2, 0.1], [-0.1, 0.4, -1.0]])
    drive.apply(action, None)
    kept = drive.snapshot(np.array([1]))
    expected = [drive.apply(action, None) for _ in range(3)][-1]
    drive.reset(np.array([1]), np.ones((1, 8)))
    drive.restore(np.array([1]), kept)
    found = [drive.apply(action[1:], np.array([1])) for _ in range(3)][-1]
    assert (found.position == expected.position[1:]).all()
    assert (found.velocity == expected.velocity[1:]).all()


def test_a_car_steers_both_wheels_about_one_centre() -> None:
    drive = made("ackermann_base", AckermannDrive, acceleration=1e3, steering_rate=1e3)
    command = drive.apply(np.array([[0.4, 0.3]]), None)
    curvature = W.curvature_of(np.array([0.3]), 0.5)
    assert np.allclose(command.position[:, :2], W.ackermann_steering(curvature, 0.5, 0.4))
    assert np.allclose(command.velocity[:, 2:], W.ackermann_wheels(np.array([0.4]), curvature, 0.1, 0.5, 0.4)[:, :2])
    modes = (ControlMode.POSITION, ControlMode.POSITION, ControlMode.VELOCITY, ControlMode.VELOCITY)
    assert drive.mode == modes


def test_a_car_turns_no_sharper_than_it_steers() -> None:
    drive = made("ackermann_base", AckermannDrive, steer_by="rate", acceleration=1e3, steering_rate=1e3)
    sharpest = W.ackermann_steering(W.curvature_of(np.array([0.6]), 0.5), 0.5, 0.4)
    assert np.allclose(drive.apply(np.array([[0.1, 1.0]]), None).position[:, :2], sharpest)
    assert np.allclose(drive.apply(np.array([[0.0, -1.0]]), None).position[:, :2], sharpest), (
        "it stands: steering stays"
    )
    assert np.allclose(drive.apply(np.array([[-0.1, 1.0]]), None).position[:, :2], -sharpest[:, ::-1])


def test_a_reset_car_has_the_steering_that_its_wheels_show() -> None:
    drive = made("ackermann_base", AckermannDrive, steer_by="rate")
    shown = W.ackermann_steering(W.curvature_of(np.array([-0.4]), 0.5), 0.5, 0.4)
    drive.reset(np.array([0]), np.concatenate([shown, np.zeros((1, 2))], axis=1))
    assert np.allclose(drive.apply(np.zeros((1, 2)), None).position[:, :2], shown)


def test_steered_wheels_wait_until_they_stand_right() -> None:
    drive = made("holonomic_base", HolonomicDrive, acceleration=1e3)
    aside = drive.apply(np.array([[0.0, 0.5, 0.0]]), None)
    assert np.allclose(np.abs(aside.position[:, :4]), np.pi / 2)
    assert np.allclose(aside.velocity, 0.0), "they stand across still"
    ahead = drive.apply(np.array([[-0.5, 0.0, 0.0]]), None)
    assert np.allclose(ahead.velocity[:, 4:] * np.cos(ahead.position[:, :4]), -0.5 / 0.08)


def test_a_ramp_goes_straight() -> None:
    ramp = Ramp(1, (1.0, 10.0), 0.1)
    assert np.allclose(ramp.toward(np.array([[0.4, 1.0]]), None), [[0.1, 0.25]])


def test_another_vehicle_is_refused() -> None:
    with pytest.raises(
        TaskError, match="has a vehicle of kind ackermann; suited to its channel 'base': ackermann_drive"
    ):
        made("ackermann_base", DifferentialDrive)
    world = compile_world(load({"world": {"name": "w", "robots": {"r": {"robot": "franka_panda"}}}}))
    view = ChannelView.of(world, world.robots[0].channels["arm"], ControlledRobot(world, "r"))
    with pytest.raises(TaskError, match="does not drive 'franka_panda', whose catalogue entry has no `vehicle`"):
        AckermannDrive(view, 1)

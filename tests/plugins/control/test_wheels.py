"""Kinematics of wheels: against rigid-body velocities at the wheels, and back."""

import numpy as np
import pytest

from anysim_control.vehicles import wheels as W

RNG = np.random.default_rng(5)
TWISTS = RNG.uniform(-1.5, 1.5, size=(50, 3))
POSITIONS = np.array([[0.3, 0.2], [0.3, -0.2], [-0.25, 0.2], [-0.2, -0.25]])


def at(twist: np.ndarray, x: float, y: float) -> np.ndarray:
    """(E, 2) velocity of a point of the base: v + omega x r."""
    return twist[:, :2] + twist[:, 2:] * np.array([-y, x])


def test_differential_wheels_roll_at_their_own_speed() -> None:
    v, w = TWISTS[:, 0], TWISTS[:, 2]
    wheels = W.differential_wheels(v, w, 0.1, 0.4)
    along = np.stack([v, np.zeros_like(v), w], axis=1)
    assert np.allclose(0.1 * wheels[:, 0], at(along, 0.0, 0.2)[:, 0])
    assert np.allclose(0.1 * wheels[:, 1], at(along, 0.0, -0.2)[:, 0])
    assert np.allclose(W.differential_twist(wheels, 0.1, 0.4), (v, w))


def test_on_the_spot_and_straight() -> None:
    wheels = W.differential_wheels(np.array([0.0, 1.0]), np.array([1.0, 0.0]), 0.1, 0.4)
    assert np.allclose(wheels, [[-2.0, 2.0], [10.0, 10.0]])


def test_front_wheels_stand_along_their_velocity() -> None:
    v, curvature = RNG.uniform(0.1, 2.0, 40), RNG.uniform(-1.6, 1.6, 40)
    twist = np.stack([v, np.zeros_like(v), v * curvature], axis=1)
    angles, wheels = W.ackermann_steering(curvature, 0.5, 0.4), W.ackermann_wheels(v, curvature, 0.1, 0.5, 0.4)
    for column, y in enumerate((0.2, -0.2)):
        front, rear = at(twist, 0.5, y), at(twist, 0.0, y)
        assert np.allclose(angles[:, column], np.arctan2(front[:, 1], front[:, 0]))
        assert np.allclose(0.1 * wheels[:, 2 + column], np.hypot(*front.T))
        assert np.allclose(0.1 * wheels[:, column], rear[:, 0])
        assert np.allclose(rear[:, 1], 0.0), "the rear axle does not slide"
    speed, omega = W.ackermann_twist(wheels[:, :2], 0.1, 0.4)
    assert np.allclose(speed, v)
    assert np.allclose(omega, v * curvature)


def test_steering_and_curvature_are_inverse() -> None:
    angles = np.linspace(-1.2, 1.2, 25)
    assert np.allclose(W.steering_of(W.curvature_of(angles, 0.5), 0.5), angles)
    assert W.curvature_of(np.array(np.pi / 4), 0.5) == pytest.approx(2.0)


def test_swerve_modules_follow_the_velocity_of_their_place() -> None:
    angles, speeds = W.swerve_modules(TWISTS, POSITIONS)
    for column, (x, y) in enumerate(POSITIONS):
        velocity = at(TWISTS, x, y)
        assert np.allclose(speeds[:, column] * np.cos(angles[:, column]), velocity[:, 0])
        assert np.allclose(speeds[:, column] * np.sin(angles[:, column]), velocity[:, 1])
    assert np.allclose(W.swerve_twist(angles, speeds, POSITIONS), TWISTS)


def test_swerve_twist_is_the_least_squares_one() -> None:
    angles, speeds = RNG.uniform(-3, 3, (20, 4)), RNG.uniform(0, 1, (20, 4))
    found = W.swerve_twist(angles, speeds, POSITIONS)
    rows = [row for x, y in POSITIONS for row in ([1.0, 0.0, -y], [0.0, 1.0, x])]
    wanted = np.stack([speeds * np.cos(angles), speeds * np.sin(angles)], axis=2).reshape(20, 8)
    best = np.stack([np.linalg.lstsq(np.array(rows), row, rcond=None)[0] for row in wanted])
    assert np.allclose(found, best)


def test_the_shortest_turn_is_at_most_a_quarter_and_moves_alike() -> None:
    angles, speeds = RNG.uniform(-np.pi, np.pi, (50, 4)), RNG.uniform(0, 1, (50, 4))
    measured = RNG.uniform(-20, 20, (50, 4))
    turned, signed = W.shortest_turn(angles, speeds, measured)
    assert (np.abs(turned - measured) <= np.pi / 2 + 1e-12).all()
    assert np.allclose(signed * np.cos(turned), speeds * np.cos(angles))
    assert np.allclose(signed * np.sin(turned), speeds * np.sin(angles))


def test_limits_shrink_all_wheels_alike() -> None:
    wheels = np.array([[1.0, 3.0], [4.0, -8.0], [0.0, 0.0]])
    factor = W.within_limits(wheels, np.array([4.0, 4.0]))
    assert np.allclose(factor, [1.0, 0.5, 1.0])


def test_a_row_does_not_depend_on_the_rows_beside_it() -> None:
    angles, speeds = W.swerve_modules(TWISTS, POSITIONS)
    assert (W.swerve_modules(TWISTS[7:8], POSITIONS)[0] == angles[7:8]).all()
    assert (W.swerve_twist(angles, speeds, POSITIONS)[7:8] == W.swerve_twist(angles[7:8], speeds[7:8], POSITIONS)).all()

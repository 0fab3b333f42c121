"""Wheel kinematics: the velocity of a base to its wheels and back, for wheels that roll on a plane without slipping.

A twist is (vx, vy, omega) of the base's frame in its own axes [m/s, rad/s]: x forward, y to the left, omega to the
left. All functions work row by row on batches: a leading axis E, then what the docstrings say.
"""

import numpy as np

from anysim.conventions import Array


def differential_wheels(speed: Array, omega: Array, radius: float, track: float) -> Array:
    """(E, 2) left and right wheel [rad/s] for speeds (E,) [m/s] and omega (E,) [rad/s] of the middle of the axle."""
    return np.stack([(speed - omega * track / 2) / radius, (speed + omega * track / 2) / radius], axis=-1)


def differential_twist(wheels: Array, radius: float, track: float) -> tuple[Array, Array]:
    """The speed (E,) [m/s] and omega (E,) [rad/s] that wheels (E, 2) [rad/s] make."""
    left, right = wheels[..., 0], wheels[..., 1]
    return radius * (left + right) / 2, radius * (right - left) / track


def steering_of(curvature: Array, wheelbase: float) -> Array:
    """The angle [rad] of a wheel in the middle of the front axle, for a curvature [1/m] of the rear one's path."""
    return np.arctan(wheelbase * curvature)


def curvature_of(steering: Array, wheelbase: float) -> Array:
    """The curvature [1/m] of the path of the rear axle's middle for an angle [rad] of a middle front wheel."""
    return np.tan(steering) / wheelbase


def ackermann_steering(curvature: Array, wheelbase: float, track: float) -> Array:
    """(E, 2) angles of the left and right front wheel [rad]: both stand across the line to the centre of turning."""
    half = curvature * track / 2
    rise = wheelbase * curvature
    return np.stack([np.arctan2(rise, 1 - half), np.arctan2(rise, 1 + half)], axis=-1)


def ackermann_wheels(speed: Array, curvature: Array, radius: float, wheelbase: float, track: float) -> Array:
    """(E, 4) rear left, rear right, front left, front right wheel [rad/s] at the rear axle's speed (E,) [m/s].

    A front wheel is as much faster than the rear one beside it as it is farther from the centre of turning.
    """
    half = curvature * track / 2
    rise = wheelbase * curvature
    sides = [1 - half, 1 + half]
    ways = [*sides, *(np.hypot(side, rise) for side in sides)]
    return np.stack([speed * way / radius for way in ways], axis=-1)


def ackermann_twist(rear: Array, radius: float, track: float) -> tuple[Array, Array]:
    """The speed (E,) [m/s] and omega (E,) [rad/s] that rear wheels (E, 2) [rad/s] make: an axle is an axle."""
    return differential_twist(rear, radius, track)


def swerve_modules(twist: Array, positions: Array) -> tuple[Array, Array]:
    """Angles (E, M) [rad] in (-pi, pi] and speeds (E, M) [m/s], not negative, of wheels at positions (M, 2) [m].

    A wheel that stands has the angle 0.
    """
    vx, vy, omega = (twist[..., i, None] for i in range(3))
    ahead, aside = vx - omega * positions[:, 1], vy + omega * positions[:, 0]
    return np.arctan2(aside, ahead), np.hypot(ahead, aside)


def swerve_twist(angles: Array, speeds: Array, positions: Array) -> Array:
    """(E, 3) the twist whose velocities at the wheels are nearest to what angles and speeds (E, M) say.

    Least squares, in closed form about the middle of the wheels; exact where the wheels agree.
    """
    ahead, aside = speeds * np.cos(angles), speeds * np.sin(angles)
    middle = positions.mean(axis=0)
    x, y = (positions - middle).T
    omega = (x * aside - y * ahead).sum(axis=-1) / (x * x + y * y).sum()
    vx, vy = ahead.mean(axis=-1) + omega * middle[1], aside.mean(axis=-1) - omega * middle[0]
    return np.stack([vx, vy, omega], axis=-1)


def shortest_turn(angles: Array, speeds: Array, measured: Array) -> tuple[Array, Array]:
    """Equivalent angles and speeds (E, M), nearest to measured angles (E, M): a wheel turns by at most a quarter.

    The angles returned go on from the measured ones, which may have wound up; a speed changes its sign where its wheel
    runs backwards.
    """
    turn = np.remainder(angles - measured + np.pi / 2, np.pi) - np.pi / 2
    backwards = np.cos(angles - (measured + turn)) < 0
    return measured + turn, np.where(backwards, -speeds, speeds)


def turned_twist(twist: Array, yaw: Array) -> Array:
    """(E, 3) of a twist (E, 3) in axes that the base is turned against by yaw (E,) [rad]."""
    c, s = np.cos(yaw), np.sin(yaw)
    vx, vy = twist[..., 0], twist[..., 1]
    return np.stack([c * vx - s * vy, s * vx + c * vy, twist[..., 2]], axis=-1)


def within_limits(wheels: Array, limits: Array) -> Array:
    """(E,) the factor in (0, 1] by which all wheels (E, K) must slow down so that each is within its limit (K,).

    One factor for all: the base goes slower along the same path.
    """
    return np.minimum(1.0, 1.0 / np.maximum((np.abs(wheels) / limits).max(axis=-1), 1e-12))

"""Easing: moves whose speed and acceleration stay within limits, whatever is asked for.

All functions are elementwise over rows, so that a row does not depend on those beside it.
"""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P

_SPEED, _ACCELERATION = 1.875, 10.0 / 3.0**0.5
"""The largest speed and acceleration of a minimum-jerk move, of its length over time, and over time squared."""
_MARGIN = 0.9
"""Of the acceleration, to brake with: between two ticks the speed is constant, so braking begins a little late."""


def move_time(length: Array, speed: float, acceleration: float) -> Array:
    """[s] that minimum-jerk moves of a length [m, rad] take within the limits."""
    return np.maximum(_SPEED * length / speed, np.sqrt(_ACCELERATION * length / acceleration))


def minimum_jerk(share: Array) -> tuple[Array, Array]:
    """How far a move has come at a share of its time (both 0 to 1), and how fast it is, in lengths over times."""
    u = share
    return u * u * u * (10.0 - u * (15.0 - 6.0 * u)), u * u * (30.0 - u * (60.0 - 30.0 * u))


def brake_speed(distance: Array, acceleration: float, response: float) -> Array:
    """The speed from which one can stop within a distance: `response` [1/s] times it when near, by a root beyond."""
    deceleration = _MARGIN * acceleration
    near = deceleration / (response * response)
    far = np.sqrt(np.maximum(2.0 * deceleration * (distance - 0.5 * near), 0.0))
    return np.where(distance <= near, response * distance, far)


def room_speeds(position: Array, lower: Array, upper: Array, acceleration: float, dt: float) -> tuple[Array, Array]:
    """The speeds (downwards, upwards) from which each joint (E, k) still stops before the ends of its range."""
    response = 1.0 / (20.0 * dt)  # the last stretch takes many ticks, else braking would come in leaps
    down, up = np.maximum(position - lower, 0.0), np.maximum(upper - position, 0.0)
    return brake_speed(np.minimum(down, 1e6), acceleration, response), brake_speed(
        np.minimum(up, 1e6), acceleration, response
    )


def shortened(vectors: Array, most: float | Array) -> Array:
    """Vectors (..., k) at most so long."""
    length = P.norm(vectors)
    factor = np.minimum(1.0, most / np.maximum(length, 1e-300))
    return vectors * np.asarray(factor)[..., None]


def toward(velocity: Array, wanted: Array, change: float | Array) -> Array:
    """Velocities (..., k) moved straight towards those wanted, by a change of at most this length."""
    return velocity + shortened(wanted - velocity, change)

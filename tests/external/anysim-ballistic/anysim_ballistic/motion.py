"""The physics: one time step of free rigid bodies. Plain numpy, which knows neither worlds nor engines.

Everything is written component by component, so that a row has the same bits whatever the batch around it.
"""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P


class Constants(NamedTuple):
    """What a step needs of F bodies in E envs.

    Attributes:
        mass: (E, F) [kg].
        com: (E, F, 3) [m], the centre of mass in the body's frame.
        inertia, inverse: (E, F, 3, 3) [kg m^2] about the centre of mass, in body axes, and its inverse.
        gravity: (E, F, 3) [m/s^2], world axes; zero for a body whose weight is compensated.
    """

    mass: Array
    com: Array
    inertia: Array
    inverse: Array
    gravity: Array


def advance(
    pose: Array, twist: Array, wrench: Array, body: Constants, dt: float, rotation_steps: int
) -> tuple[Array, Array]:
    """Poses (E, F, 7) and twists (E, F, 6) one step of `dt` [s] later, under wrenches (E, F, 6) at the centres of mass.

    The centre of mass moves by semi-implicit Euler. The rotation carries the angular momentum in world axes, which no
    gyroscopic term can change, and turns by the midpoint rule in `rotation_steps` parts.
    """
    turn, rate = pose[..., 3:], twist[..., 3:]
    arm = P.rotate(turn, body.com)
    centre, speed = pose[..., :3] + arm, twist[..., :3] + P.cross(rate, arm)

    speed = speed + dt * (body.gravity + wrench[..., :3] / body.mass[..., None])
    centre = centre + dt * speed

    momentum = P.rotate(turn, _times(body.inertia, P.rotate_inverse(turn, rate))) + dt * wrench[..., 3:]
    part = dt / rotation_steps
    for _ in range(rotation_steps):
        middle = _turned(turn, _rate(turn, momentum, body), 0.5 * part)
        turn = _turned(turn, _rate(middle, momentum, body), part)
    rate = _rate(turn, momentum, body)

    # back from the centre of mass to the frame's origin, which is what anysim calls a body's pose and velocity
    arm = P.rotate(turn, body.com)
    return (np.concatenate([centre - arm, turn], axis=-1), np.concatenate([speed - P.cross(rate, arm), rate], axis=-1))


def _rate(turn: Array, momentum: Array, body: Constants) -> Array:
    """The angular velocity, world axes, of a body so turned that has this angular momentum."""
    return P.rotate(turn, _times(body.inverse, P.rotate_inverse(turn, momentum)))


def _turned(turn: Array, rate: Array, time: float) -> Array:
    """The quaternion after turning at a constant rate, world axes."""
    speed = P.norm(rate)
    axis = rate / np.where(speed == 0.0, 1.0, speed)[..., None]
    return P.normalize(P.multiply(P.from_axis_angle(axis, speed * time), turn))


def _times(matrix: Array, vector: Array) -> Array:
    x, y, z = vector[..., 0:1], vector[..., 1:2], vector[..., 2:3]
    return matrix[..., :, 0] * x + matrix[..., :, 1] * y + matrix[..., :, 2] * z

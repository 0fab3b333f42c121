"""The law of `body.linear_damping` and `body.angular_damping`, for engines whose own damping is another one.

A body that nothing touches slows down as exp(-rate t). Over a step of `dt` a wrench of
-(1 - exp(-rate dt)) / dt times its momenta does exactly that, whatever the rate.
"""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P


def gain(rate: Array, dt: float) -> Array:
    """[1/s] the share of its momentum that a body loses in a step, over the step."""
    return -np.expm1(-rate * dt) / dt


def drag(gains: Array, mass: Array, moments: Array, axes: Array, velocity: Array, rate: Array) -> Array:
    """Wrenches (..., 6) [N, N m] at the centres of mass, world axes.

    Args:
        gains: (..., 2) of `gain`, linear and angular.
        mass: (...,) [kg].
        moments: (..., 3) principal moments [kg m^2].
        axes: (..., 4) the orientation of the principal axes in the world.
        velocity: (..., 3) of the centres of mass [m/s].
        rate: (..., 3) angular [rad/s].
    """
    force = -(gains[..., :1] * mass[..., None]) * velocity
    turning = P.rotate(axes, moments * P.rotate_inverse(axes, rate))
    return np.concatenate([force, -gains[..., 1:] * turning], axis=-1)

"""Checks of a World's drives before anything is built."""

import warnings

import numpy as np

from anysim.conventions import Array
from anysim.errors import EngineError
from anysim.kinematics.dynamics import coupling, mass_matrix
from anysim.model.world import Actuation, ControlMode, World


class UnstableGainsWarning(UserWarning):
    """Explicit drives that are too stiff for the time step."""


def check_drives(world: World) -> None:
    """Warn of explicit drives that cannot be stable, and refuse velocity limits that no drive can keep.

    Raises:
        EngineError: velocity limits are enforced on a position drive without damping, which asks for no velocity.
    """
    if world.physics.velocity_limits:
        for actuator in world.actuators:
            limit = world.joints[actuator.joint].velocity_limit
            if np.isfinite(limit) and actuator.kd == 0 and actuator.mode is not ControlMode.EFFORT:
                raise EngineError(
                    f"drive '{actuator.name}' has kd = 0 and cannot keep the velocity limit of {limit:g}; give it "
                    f"damping, or set physics.velocity_limits: ignore"
                )
    if world.physics.actuation is Actuation.EXPLICIT_PD and (ratio := damping_ratio(world)) > 1:
        warnings.warn(
            f"explicit drives of '{world.name}' are too stiff for dt = {world.physics.dt:g} s: the largest eigenvalue "
            f"of dt Kd / M at the initial pose is {ratio:.3g} (up to 1 is well damped, above 2 diverges); lower kd or "
            f"dt, or use physics.actuation: implicit_pd",
            UnstableGainsWarning,
            stacklevel=3,
        )


def speed_bound(damping: Array, limit: Array) -> Array:
    """Bound on |kp (q* - q) + kd qd*|: kd times the velocity limit; none without damping or without a limit."""
    bound = np.full(np.broadcast_shapes(damping.shape, limit.shape), np.inf)
    return np.multiply(damping, limit, out=bound, where=damping > 0)


def damping_ratio(world: World) -> float:
    """The largest eigenvalue of dt Kd inv(M) at the initial pose: what a step takes off the fastest motion.

    An explicit step multiplies that motion by 1 - this number, so that it alternates above 1 and grows above 2.
    """
    mass = mass_matrix(world, world.initial_body_pose)
    damping = np.zeros(len(mass))
    for actuator in world.actuators:
        if actuator.mode is not ControlMode.EFFORT:
            damping[actuator.joint] += actuator.kd
    together = coupling(world)
    matrix = together.T @ mass @ together
    drag = together.T @ np.diag(damping) @ together
    if not len(matrix) or not drag.any():
        return 0.0
    if np.linalg.matrix_rank(matrix) < len(matrix):
        return float("inf")
    return float(world.physics.dt * np.abs(np.linalg.eigvals(np.linalg.solve(matrix, drag))).max())

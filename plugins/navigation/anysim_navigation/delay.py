"""Bases that do what they are told some time later, as who walks does: where they are then, what is around there."""

import numpy as np

from anysim.conventions import Array
from anysim_navigation.dynamic_window import STEP
from anysim_navigation.pose_control import in_frame


def later(pose: Array, told: Array) -> Array:
    """Poses x, y, yaw (n, 3) after velocities (n, K, 3) in the frame of the base, each of them for a step."""
    x, y, yaw = pose.T.copy()
    for forward, left, turn in told.transpose(1, 2, 0):
        middle = yaw + 0.5 * STEP * turn
        x += STEP * (np.cos(middle) * forward - np.sin(middle) * left)
        y += STEP * (np.sin(middle) * forward + np.cos(middle) * left)
        yaw += STEP * turn
    return np.stack([x, y, yaw], axis=1)


def seen_from(field: Array, cell: float, here: Array, there: Array) -> Array:
    """A field of distances (rows, columns) [m] about a pose (3,), about another one; FAR where it does not reach."""
    from scipy.ndimage import map_coordinates

    from anysim_navigation.kernels.window import FAR

    middle = 0.5 * (np.array(field.shape) - 1.0)
    i, j = np.indices(field.shape).reshape(2, -1) - middle[:, None]
    c, s = np.cos(there[2] - here[2]), np.sin(there[2] - here[2])
    x, y = in_frame(here, there[None, :2])[0] / cell
    at = np.stack([y + s * j + c * i, x + c * j - s * i]) + middle[:, None]
    return np.ascontiguousarray(map_coordinates(field, at, order=1, cval=FAR).reshape(field.shape))

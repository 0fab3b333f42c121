"""Full inertia tensors and the principal moments with their frame that PhysX wants, both ways."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import EngineError
from anysim.kinematics.inertia import tensor
from anysim.math import pose as P
from anysim.model.world import Inertial


class Principal(NamedTuple):
    """Principal moments (3,) [kg m^2] and the frame they are in (4,) xyzw, relative to the body."""

    moments: Array
    frame: Array


def principal(name: str, inertia: Array) -> Principal:
    """The principal moments of one tensor (xx, yy, zz, xy, xz, yz).

    A diagonal tensor keeps the body's axes. Otherwise the axes are right-handed, each with its largest component
    positive, so that equal tensors give equal bits.

    Raises:
        EngineError: no rigid body has this tensor.
    """
    xx, yy, zz, xy, xz, yz = (float(v) for v in inertia)
    matrix = tensor(Inertial(1.0, inertia=(xx, yy, zz, xy, xz, yz)))
    if not np.any(matrix - np.diag(np.diag(matrix))):
        moments, axes = np.diag(matrix).copy(), np.eye(3)
    else:
        moments, axes = np.linalg.eigh(matrix)
        for column in range(2):
            axes[:, column] *= np.sign(axes[np.argmax(np.abs(axes[:, column])), column])
        axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    _check(name, moments)
    return Principal(moments, P.from_matrix(axes))


def full(moments: Array, frame: Array) -> Array:
    """The tensor (6,) of principal moments (3,) in a frame (4,) xyzw."""
    axes = P.to_matrix(np.asarray(frame, dtype=float))
    matrix = axes @ np.diag(np.asarray(moments, dtype=float)) @ axes.T
    return matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]


def _check(name: str, moments: Array) -> None:
    low, middle, high = sorted(float(m) for m in moments)
    if low <= 0 or low + middle < high * (1 - 1e-9):
        raise EngineError(
            f"the inertia of body '{name}' belongs to no rigid body: its principal moments are {low:.4g}, {middle:.4g} "
            f"and {high:.4g} kg m^2; each must be positive and no larger than the sum of the other two"
        )

"""Full inertia tensors and MuJoCo's principal axes, both ways."""

import numpy as np

from anysim.conventions import Array, wxyz_from_xyzw, xyzw_from_wxyz
from anysim.errors import EngineError
from anysim.math import pose as P


def principal(inertia: Array) -> tuple[Array, Array]:
    """Principal moments (3,) and their frame (4,) wxyz of one tensor (xx, yy, zz, xy, xz, yz) [kg m^2].

    A diagonal tensor keeps its axes. Otherwise the moments descend and the frame is the right-handed one whose axes
    have their largest component positive, so that equal tensors give equal bits.
    """
    xx, yy, zz, xy, xz, yz = (float(v) for v in inertia)
    if xy == 0.0 and xz == 0.0 and yz == 0.0:
        return np.array([xx, yy, zz]), np.array([1.0, 0.0, 0.0, 0.0])
    moments, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    moments, axes = moments[::-1].copy(), axes[:, ::-1].copy()
    for column in range(2):
        largest = np.argmax(np.abs(axes[:, column]))
        if axes[largest, column] < 0:
            axes[:, column] *= -1
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return moments, wxyz_from_xyzw(P.from_matrix(axes))


def full(moments: Array, frame: Array) -> Array:
    """Tensors (..., 6) of principal moments (..., 3) in frames (..., 4) wxyz."""
    axes = P.to_matrix(xyzw_from_wxyz(frame))
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    terms = [sum(axes[..., i, k] * moments[..., k] * axes[..., j, k] for k in range(3)) for i, j in pairs]
    return np.stack(terms, axis=-1)


def check_physical(name: str, moments: Array) -> None:
    """Raise EngineError unless the moments are those of a body with mass in space (positive, A + B >= C)."""
    low, middle, high = sorted(float(m) for m in moments)
    if low <= 0 or low + middle < high * (1 - 1e-9):
        raise EngineError(
            f"the inertia of body '{name}' belongs to no rigid body: its principal moments are {low:.4g}, {middle:.4g} "
            f"and {high:.4g} kg m^2; each must be positive and no larger than the sum of the other two"
        )

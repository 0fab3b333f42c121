"""Resistance of cloth to bending: a quadratic energy of surfaces that bend and do not stretch.

Between triangles of a sheet that is flat at rest the energy D/2 times the square of the curvature, integrated over the
sheet, is half of D x^T Q x with a matrix Q that does not change, as long as lengths do not. Its rows sum to zero, so it
gives no momentum.
"""

from collections.abc import Callable

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P


def bending_matrix(points: Array, hinges: Array) -> Array:
    """(V, V) [1/m^2] Q, from places (V, 2) at rest and hinges (H, 4), an edge and the points opposite to it."""
    a, b, c, d = (points[hinges[:, i]] for i in range(4))

    def cotangent(one: Array, two: Array) -> Array:
        return P.dot(one, two) / np.maximum(np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]), 1e-15)

    def area(at: Array) -> Array:
        one, two = b - a, at - a
        return np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]) / 2

    at_a, at_b = (cotangent(b - a, c - a), cotangent(b - a, d - a)), (cotangent(a - b, c - b), cotangent(a - b, d - b))
    row = np.stack([at_b[0] + at_b[1], at_a[0] + at_a[1], -at_a[0] - at_b[0], -at_a[1] - at_b[1]], axis=1)
    local = 1.0 / (area(c) + area(d))[:, None, None] * row[:, :, None] * row[:, None, :]
    found = np.zeros((len(points), len(points)))
    np.add.at(found, (hinges[:, :, None], hinges[:, None, :]), local)
    return found


def fastest(matrix: Array, shares: Array) -> float:
    """[1/s^2] the square of the rate of its fastest wave, of a rigidity of 1 N m and 1 kg/m^2; shares (V,) [m^2]."""
    shape = np.where(np.arange(len(shares)) % 2, 1.0, -1.0) + 1e-3 * np.arange(len(shares))
    rate = 0.0
    for _ in range(100):
        shape = matrix @ shape / shares
        rate = float(P.norm(shape))
        shape /= max(rate, 1e-300)
    return rate


def bending_force(
    matrix: Array, rigidity: float, damping: float, mass: Array, h: float
) -> Callable[[int, Array, Array], Array] | None:
    """Forces (V, 3) [N] on points, as `FlexSource.inner`, from what is so at the beginning of a step of `h` [s].

    What damps is that of the step's end, as if nothing else acted. A mass of inf [kg] is of a point that does not move.
    """
    if rigidity <= 0.0:
        return None
    from scipy.sparse import csc_array, csr_array
    from scipy.sparse.linalg import splu

    stiff = -rigidity * matrix
    bent = csr_array(stiff)  # a point has some 13 neighbours, and no more entries
    later = csc_array(np.eye(len(mass)) - h * damping * stiff / mass[None, :])
    factors = splu(later, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def force(_: int, places: Array, velocities: Array) -> Array:
        both = bent @ np.concatenate([places, damping * velocities], axis=1)
        return both[:, :3] + factors.solve(both[:, 3:])

    return force

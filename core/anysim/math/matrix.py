"""Small matrices in one order of operations, so that results are the same bits on every processor.

numpy hands `@`, `dot` and `numpy.linalg` to BLAS and LAPACK, whose kernels are chosen for the processor at hand and
round differently. What decides a trajectory is computed here instead; `blas_kernel` names the one that the rest had.
"""

import functools
from math import copysign, sqrt

import numpy as np

from anysim.conventions import Array

_SWEEPS = 32
"""Jacobi's method converges quadratically: 5 or 6 sweeps are usual for three rows."""


def product(*matrices: Array) -> Array:
    """The product of matrices (..., N, K), (..., K, M), …, each sum in index order."""
    return functools.reduce(_product, matrices)


def _product(a: Array, b: Array) -> Array:
    total = np.zeros((*np.broadcast_shapes(a.shape[:-2], b.shape[:-2]), a.shape[-2], b.shape[-1]))
    for k in range(a.shape[-1]):
        total += a[..., :, k, None] * b[..., None, k, :]
    return total


def determinant(matrix: Array) -> Array:
    """Of matrices (..., 3, 3)."""
    a, b, c = (matrix[..., i, :] for i in range(3))
    total = a[..., 0] * (b[..., 1] * c[..., 2] - b[..., 2] * c[..., 1])
    total = total + a[..., 1] * (b[..., 2] * c[..., 0] - b[..., 0] * c[..., 2])
    return total + a[..., 2] * (b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0])


def eigen(matrix: Array) -> tuple[Array, Array]:
    """Eigenvalues (3,) of a symmetric matrix (3, 3) in ascending order, and its eigenvectors (3, 3) as columns.

    Cyclic Jacobi rotations (Golub and Van Loan, Matrix Computations, 4th edition, 8.5): small eigenvalues have as many
    right digits as large ones.
    """
    a: list[list[float]] = np.asarray(matrix, dtype=float).tolist()
    v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    for _ in range(_SWEEPS):
        if a[0][1] == a[0][2] == a[1][2] == 0.0:
            break
        for p, q in ((0, 1), (0, 2), (1, 2)):
            _rotate(a, v, p, q)
    values, vectors = np.array([a[0][0], a[1][1], a[2][2]]), np.array(v)
    order = np.argsort(values, kind="stable")
    return values[order], vectors[:, order]


def _rotate(a: list[list[float]], v: list[list[float]], p: int, q: int) -> None:
    """Turn the plane of two axes so that the entry between them vanishes."""
    entry = a[p][q]
    if abs(a[p][p]) + abs(entry) == abs(a[p][p]) and abs(a[q][q]) + abs(entry) == abs(a[q][q]):
        a[p][q] = a[q][p] = 0.0  # too small to be seen beside either
        return
    half = 0.5 * (a[q][q] - a[p][p]) / entry
    tangent = copysign(1.0, half) / (abs(half) + sqrt(1.0 + half * half))
    cosine = 1.0 / sqrt(1.0 + tangent * tangent)
    sine = tangent * cosine
    a[p][p] -= tangent * entry
    a[q][q] += tangent * entry
    a[p][q] = a[q][p] = 0.0
    r = 3 - p - q
    first, second = a[r][p], a[r][q]
    a[r][p] = a[p][r] = cosine * first - sine * second
    a[r][q] = a[q][r] = sine * first + cosine * second
    for row in v:
        row[p], row[q] = cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]


def blas_kernel() -> str:
    """The linear algebra that numpy uses in this process, as `openblas SkylakeX`: it may round otherwise elsewhere."""
    from threadpoolctl import threadpool_info

    found = [entry for entry in threadpool_info() if entry.get("user_api") == "blas"]
    names = (f"{entry['internal_api']} {entry.get('architecture') or entry.get('version') or ''}" for entry in found)
    return ", ".join(sorted({name.strip() for name in names})) or "unknown"

"""The least ball around points of the plane or of space."""

from itertools import combinations

import numpy as np

from anysim.conventions import Array

_ROUNDING = 1e-9
_ROUNDS = 1000
"""Each finds a larger ball than the one before; some ten are usual."""


def least_ball(points: Array) -> tuple[Array, float]:
    """The centre (D,) and the radius of the least ball around points (V, D), D = 2 or 3, exact but for rounding.

    The ball of a few points, to which the one that is farthest outside is added until none is.
    """
    held = points[:1]
    centre = points[0]
    for _ in range(_ROUNDS):
        away = np.sqrt(((points - centre) ** 2).sum(axis=1))
        far = int(np.argmax(away))
        radius = float(np.sqrt(((held - centre) ** 2).sum(axis=1).max()))
        if away[far] <= radius * (1 + _ROUNDING) + 1e-15:
            break
        held, centre = _of_few(np.concatenate([held, points[far : far + 1]]))
    return centre, float(np.sqrt(((points - centre) ** 2).sum(axis=1).max()))


def _of_few(points: Array) -> tuple[Array, Array]:
    """Those of at most D + 2 points that are on the least ball around all of them, and its centre."""
    best, middle, least = points, points.mean(axis=0), np.inf
    for size in range(2, points.shape[1] + 2):
        for chosen in combinations(range(len(points)), size):
            on = points[list(chosen)]
            centre = _through(on)
            if centre is None:
                continue
            away = ((points - centre) ** 2).sum(axis=1)
            own = float(((on - centre) ** 2).sum(axis=1).max())
            if own < least * (1 - _ROUNDING) and away.max() <= own * (1 + 2 * _ROUNDING):
                best, middle, least = on, centre, own
    return best, middle


def _through(points: Array) -> Array | None:
    """The centre of the least ball that has all of these points on it; None where none has."""
    edges = points[1:] - points[0]
    gram = edges @ edges.T
    if np.linalg.matrix_rank(gram, hermitian=True) < len(edges):
        return None
    return points[0] + np.linalg.solve(gram, np.diag(gram) / 2) @ edges

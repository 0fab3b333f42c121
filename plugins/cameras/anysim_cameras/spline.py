"""Splines through waypoints, as fast as limits of speed and acceleration allow all along.

A cubic between two waypoints has its largest speed where the derivative of a quartic is zero, and its largest
acceleration at an end, so both are known exactly, and with them the time that the whole way takes.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P


class Limits(NamedTuple):
    """Limits of some coordinates together: of the length of their velocity, and of their acceleration.

    Attributes:
        columns: which coordinates.
        speed: [m/s] or [rad/s].
        acceleration: [m/s^2] or [rad/s^2].
    """

    columns: Array
    speed: float
    acceleration: float


class Spline(NamedTuple):
    """A way through waypoints (S + 1, k), at rest at both ends, with steady velocity and acceleration between.

    Attributes:
        times: (S + 1,) [s] at the waypoints, from 0.
        cubics: (S, 4, k) coefficients by the power of the time since the last waypoint.
    """

    times: Array
    cubics: Array

    def slower(self, factor: float) -> "Spline":
        """The same way in `factor` times the time."""
        return Spline(self.times * factor, self.cubics / factor ** np.arange(4.0)[:, None])

    def peaks(self, columns: Array) -> tuple[float, float]:
        """The largest speed and acceleration of some coordinates together."""
        spans, cubics = np.diff(self.times), self.cubics[:, :, columns]
        speed = acceleration = 0.0
        for span, (_, b, c, d) in zip(spans, cubics, strict=True):
            square = np.array([9 * d @ d, 12 * c @ d, 4 * c @ c + 6 * b @ d, 4 * b @ c, b @ b])  # of the speed
            turning = np.roots(np.polyder(square))
            turning = turning[np.isreal(turning)].real
            inner = turning[(turning > 0) & (turning < span)]
            speed = max(speed, *np.polyval(square, [0.0, span, *inner]))
            acceleration = max(acceleration, *P.norm(2 * c + 6 * d * np.array([[0.0], [span]])))
        return float(np.sqrt(max(speed, 0.0))), float(acceleration)

    def factor(self, limits: Sequence[Limits]) -> float:
        """How many times slower it has to be gone along, so that the limits hold; below 1 where it may be faster."""
        found = [(*self.peaks(one.columns), one) for one in limits]
        ratios = [max(speed / one.speed, (push / one.acceleration) ** 0.5) for speed, push, one in found]
        return max(ratios, default=0.0)


def through(points: Array, limits: Sequence[Limits]) -> Spline:
    """The spline through points (S + 1, k), in the least time within the limits that keeps its shape.

    Waypoints follow each other at the times that each stretch would take by itself.
    """
    steps = np.diff(points, axis=0)
    spans = np.zeros(len(steps))
    for one in limits:
        length = P.norm(steps[:, one.columns])
        spans = np.maximum(spans, np.maximum(length / one.speed, np.sqrt(length / one.acceleration)))
    kept = spans > 1e-9  # a waypoint that is where the last one was adds nothing
    points, spans = points[np.concatenate([[True], kept])], spans[kept]
    if not len(spans):
        return Spline(np.zeros(1), np.zeros((0, 4, points.shape[1])))
    found = _clamped(points, spans)
    return found.slower(found.factor(limits) * (1 + 1e-12))


def _clamped(points: Array, spans: Array) -> Spline:
    """The cubic spline whose velocity is zero at its ends and whose acceleration has no steps."""
    n, ratio = len(points), np.diff(points, axis=0) / spans[:, None]
    velocity = np.zeros_like(points)
    if n > 2:
        before, after = spans[:-1], spans[1:]
        matrix = np.diag(2 * (before + after)) + np.diag(after[1:], -1) + np.diag(before[:-1], 1)
        right = 3 * (after[:, None] * ratio[:-1] + before[:, None] * ratio[1:])
        velocity[1:-1] = np.linalg.solve(matrix, right)
    b, last, h = velocity[:-1], velocity[1:], spans[:, None]
    c = (3 * ratio - 2 * b - last) / h
    d = (b + last - 2 * ratio) / (h * h)
    return Spline(np.concatenate([[0.0], np.cumsum(spans)]), np.stack([points[:-1], b, c, d], axis=1))

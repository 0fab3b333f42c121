"""Direct control to a pose on free ground: straight there, or turning on the spot, driving, and turning again."""

from math import atan2, copysign, cos, hypot, sin, sqrt
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim_navigation.limits import BaseKind, BaseLimits

GAIN = 4.0
"""[1/s] of what is left, near the goal."""
TURNED, SWERVED = 0.05, 0.5
"""[rad] what turns on the spot drives from that bearing on, and turns again beyond the other."""
BACKWARDS = 0.3
"""[m] what lies behind and is not further away is reached backwards."""


class PoseControl(NamedTuple):
    """Proportional control, slowed so that the base can brake.

    Attributes:
        limits: of the base.
        close: [m] what is left within it is not worth another turn.
        braking: of the accelerations, the share that is used.
    """

    limits: BaseLimits
    close: float = 0.01
    braking: float = 0.4

    def twist(self, way: Array, turn: float, last: Array) -> Array:
        """Velocities (3,) towards a place (2,) [m] in the frame of the base, and a heading `turn` [rad] to its left.

        `last` (3,) is what was told last: who is driving keeps to it.
        """
        distance = hypot(way[0], way[1])
        if self.limits.kind is BaseKind.ACKERMANN:
            return self._as_a_car(way, distance)
        if self.limits.kind is not BaseKind.DIFFERENTIAL:
            share = self._speed(distance) / max(distance, 1e-9)
            return self._bounded(np.array([share * way[0], share * way[1], self._rate(turn)]))
        if distance <= self.close:
            return np.array([0.0, 0.0, self._rate(turn)])
        ahead = -1.0 if way[0] < 0 and distance < BACKWARDS else 1.0
        bearing = atan2(ahead * way[1], ahead * way[0])
        if abs(bearing) > (SWERVED if abs(last[0]) > 1e-6 else TURNED):
            return np.array([0.0, 0.0, self._rate(bearing)])
        speed = ahead * self._speed(distance * max(0.0, cos(bearing)))
        return self._bounded(np.array([speed, 0.0, self._rate(bearing) if distance > 0.05 else 0.0]))

    def turning(self, turn: float) -> Array:
        """Velocities (3,) that turn on the spot by an angle [rad] to the left; a car cannot."""
        still = self.limits.kind is BaseKind.ACKERMANN
        return np.array([0.0, 0.0, 0.0 if still else self._rate(turn)])

    def _as_a_car(self, way: Array, distance: float) -> Array:
        speed = copysign(self._speed(distance), way[0]) if distance > self.close else 0.0
        curvature = 2 * way[1] / max(distance, 1e-6) ** 2
        most = 1.0 / self.limits.turning_radius
        return self._bounded(np.array([speed, 0.0, abs(speed) * copysign(min(abs(curvature), most), curvature)]))

    def _bounded(self, twist: Array) -> Array:
        """The twist, all of it slower where a component is too fast."""
        bound = np.where(twist < 0, self.limits.low, self.limits.high)
        over = np.abs(twist[:2]) / np.maximum(np.abs(bound[:2]), 1e-9)
        twist[:2] /= max(1.0, float(over.max()))
        return twist

    def _speed(self, distance: float) -> float:
        slow = sqrt(2 * self.braking * self.limits.acceleration[0] * distance)
        return min(float(self.limits.high[0]), slow, GAIN * distance)

    def _rate(self, angle: float) -> float:
        size = abs(angle)
        slow = sqrt(2 * self.braking * self.limits.acceleration[2] * size)
        return copysign(min(float(self.limits.high[2]), slow, GAIN * size), angle)


def in_frame(pose: Array, points: Array) -> Array:
    """Points (K, 2) of the world in the frame of a pose x, y, yaw."""
    c, s = cos(pose[2]), sin(pose[2])
    off = points - pose[:2]
    return np.stack([c * off[:, 0] + s * off[:, 1], c * off[:, 1] - s * off[:, 0]], axis=1)

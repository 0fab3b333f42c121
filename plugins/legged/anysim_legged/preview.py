"""The linear inverted pendulum: the centre of mass that belongs to a centre of pressure known ahead.

At a constant height z, `c'' = w^2 (c - p)` with w^2 = g / z. Sampled at steps of h with central differences it is a
tridiagonal system, `-c[k-1] + (2 + b) c[k] - c[k+1] = b p[k]` with b = (w h)^2. Its bounded solution from a given
c[0] has a closed form: with the stable root r of r + 1/r = 2 + b,

    c[1] = r c[0] + b sum_k r^k p[k]   (k = 1, 2, ...),

a fixed row of weights on the pressure ahead. Walking needs no more than c[1] of each tick.
"""

import numpy as np

from anysim.conventions import Array


class Preview:
    """Weights for one height of each direction, and a tick.

    Attributes:
        times: (H,) [s] from now, at which the pressure is to be given: one tick ahead first.
    """

    def __init__(self, omega: Array | float, tick: float, horizon: float) -> None:
        b = (omega * tick) ** 2
        self._root = 1.0 + b / 2.0 - np.sqrt(b + b * b / 4.0)
        count = max(1, round(horizon / tick))
        self.times = tick * np.arange(1, count + 1)
        self._weights = b * self._root ** np.arange(1, count + 1)[:, None]
        self._weights[-1] /= 1.0 - self._root  # from there on the pressure stays

    def next(self, com: Array, pressure: Array) -> Array:
        """The centre of mass (2,) a tick after `com` (2,), for the pressure (H, 2) at `times`."""
        return self._root * com + (self._weights * pressure).sum(axis=0)

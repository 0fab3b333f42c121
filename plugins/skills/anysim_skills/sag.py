"""Sag of an arm that carries its own weight, made up for once its command is at its end."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P

RATE = 3.0
"""[1/s] at which what is missing is added to the command."""
MOST = 0.03
"""[m] that are added at most."""


class Sag:
    """How far above their commands the tools (N, 3) are told to be [m], in an arm whose weight nothing cancels."""

    def __init__(self, num_envs: int, control_dt: float) -> None:
        self.offset = np.zeros((num_envs, 3))
        self._share = RATE * control_dt

    def forget(self, ids: Array) -> None:
        """Nothing is made up for in these envs."""
        self.offset[ids] = 0.0

    def learn(self, ids: Array, missing: Array) -> None:
        """In these envs the command is at its end, and the tool `missing` (n, 3) [m] before it."""
        offset = self.offset[ids] + self._share * missing
        self.offset[ids] = offset * np.minimum(1.0, MOST / np.maximum(P.norm(offset), 1e-9))[:, None]

"""Rewards in deviations of the return, for learners whose critic expects numbers about one."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from anysim.conventions import Array

CLIP = 10.0
"""Scaled rewards are cut off there."""


class ReturnScale:
    """Divides rewards by the running deviation of the discounted return of the envs.

    Attributes:
        mean, variance: of the returns so far.
        count: how many there were.
    """

    def __init__(self, num_envs: int, gamma: float) -> None:
        """`gamma` is the discount of a reward a control step later."""
        self._gamma, self._return = gamma, np.zeros(num_envs)
        self.mean, self.variance, self.count = 0.0, 1.0, 0.0

    def __call__(self, reward: Array, done: Array) -> Array:
        """Rewards (N,) of a step, scaled; episodes `done` (N,) bool end with it."""
        self._return = self._gamma * self._return + reward
        self._take_in(self._return)
        self._return[done] = 0.0
        return np.clip(reward / np.sqrt(self.variance + 1e-8), -CLIP, CLIP)

    def state(self) -> dict[str, Any]:
        """What a checkpoint keeps."""
        held = {"mean": self.mean, "variance": self.variance, "count": self.count}
        return {**held, "returns": self._return.copy()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from there."""
        self.adopt(state)
        self._return[:] = state["returns"]

    def adopt(self, state: Mapping[str, Any]) -> None:
        """Begin with the scale of others, however many envs they had."""
        self.mean, self.variance, self.count = (float(state[name]) for name in ("mean", "variance", "count"))

    def _take_in(self, rows: Array) -> None:
        """Mean and variance of two samples together (Chan et al. 1979)."""
        number = len(rows)
        total, apart = self.count + number, float(rows.mean()) - self.mean
        squares = self.variance * self.count + float(rows.var()) * number + apart**2 * self.count * number / total
        self.mean, self.variance, self.count = self.mean + apart * number / total, squares / total, total

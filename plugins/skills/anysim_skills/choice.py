"""Choices among candidates: the one that needs the least motion, then the next where that has failed."""

import numpy as np

from anysim.conventions import Array


class Choice:
    """Candidates of each env in the order of their effort, and how many of them have been given up."""

    def __init__(self, num_envs: int, count: int) -> None:
        self._order = np.zeros((num_envs, count), dtype=np.int64)
        self._reachable, self._given_up = np.zeros((2, num_envs), dtype=np.int64)

    def again(self, ids: Array | int) -> None:
        """None has been given up in these envs."""
        self._given_up[ids] = 0

    def next(self, env: int) -> bool:
        """Give the present one up; False if it was the last that can be reached."""
        left = bool(self._given_up[env] + 1 < self._reachable[env])
        self._given_up[env] += left
        return left

    def choose(self, ids: Array, effort: Array) -> Array:
        """(n,) the candidate of each of these envs, of efforts (n, count), infinite for what cannot be reached."""
        self._order[ids] = np.argsort(effort, axis=1, kind="stable")
        self._reachable[ids] = np.isfinite(effort).sum(axis=1)
        return self._order[ids, np.minimum(self._given_up[ids], effort.shape[1] - 1)]

    def none_left(self, ids: Array) -> Array:
        """(n,) bool: no candidate can be reached that has not been given up."""
        return self._reachable[ids] <= self._given_up[ids]

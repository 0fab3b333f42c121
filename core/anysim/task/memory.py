"""Memory of terms: numbers that a term keeps for each env during an episode."""

from collections.abc import Callable

import numpy as np

from anysim.conventions import Array


class Memory:
    """Numbers (N, width) that change at most once a control step, are zero when an episode begins, and are snapshotted.

    A term that needs one is a class: it asks the scene for it in its constructor, and its instances are called.
    """

    def __init__(self, num_envs: int, width: int) -> None:
        self.values = np.zeros((num_envs, width))
        self.seen = np.full(num_envs, -1, dtype=np.int64)
        """The control step of the episode in which each row was last brought up to date; -1 before the first."""

    def forget(self, env_ids: Array) -> None:
        """An episode begins."""
        self.values[env_ids] = 0.0
        self.seen[env_ids] = -1

    def update(self, env_ids: Array, elapsed: Array, change: Callable[[Array, Array], Array]) -> Array:
        """The numbers (n, width) of these envs after `change(before, first)`, where that was not made in this step.

        Args:
            elapsed: (n,) control steps since each env's reset.
            change: gets the numbers (n, width) and whether they are an episode's first (n,), and returns new numbers.
        """
        before, seen = self.values[env_ids], self.seen[env_ids]
        due = seen != elapsed
        if not due.any():
            return before
        after = np.where(due[:, None], change(before, seen < 0), before)
        self.values[env_ids], self.seen[env_ids] = after, elapsed
        return after

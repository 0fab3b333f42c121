"""Policies without knowledge: what a task yields by chance, and by doing nothing."""

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.task.contract import Obs
from anysim.task.env import TaskEnv


class ZeroPolicy:
    """The action zero, or what is nearest to it within the bounds."""

    def __init__(self, env: TaskEnv) -> None:
        self._action = np.clip(np.zeros(env.action_dim), *env.action_bounds)

    def reset(self, env_ids: Array) -> None:
        """Nothing: it remembers nothing."""

    def act(self, obs: Obs, env_ids: Array) -> Array:
        """(n, A), all alike."""
        return np.tile(self._action, (len(env_ids), 1))


class RandomPolicy:
    """Actions that are uniform between the bounds, drawn anew in each step from the episode's own stream."""

    def __init__(self, env: TaskEnv) -> None:
        self._env, (self._low, self._high) = env, env.action_bounds
        open_ended = np.flatnonzero(~(np.isfinite(self._low) & np.isfinite(self._high)))
        if len(open_ended):
            labels = ", ".join(str(env.action_spaces.labels[k]) for k in open_ended)
            raise TaskError(f"the policy 'random' needs bounds of every action; without are {labels}")

    def reset(self, env_ids: Array) -> None:
        """Nothing: each step has a stream of its own."""

    def act(self, obs: Obs, env_ids: Array) -> Array:
        """(n, A) within the bounds."""
        elapsed, streams = self._env.scene.elapsed, self._env.streams
        rows = [streams.generator(i, "policy/random", int(elapsed[i])) for i in env_ids.tolist()]
        return np.array([generator.uniform(self._low, self._high) for generator in rows])

"""Chunks of actions as RLinf's trainers step them: envs that are reset between chunks, never within one."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math.arrays import numbers
from anysim.task.contract import Obs, Status
from anysim.task.env import TaskEnv

PRIVILEGED = "privileged"


class SingleStep(NamedTuple):
    """Results of one step: observations, rewards, ends (N,), and infos."""

    obs: dict[str, Any]
    rewards: Array
    terminations: Array
    truncations: Array
    infos: dict[str, Any]


class Chunk(NamedTuple):
    """Results of one chunk of K steps: a list of K observations and infos; rewards and ends (N, K).

    Where envs are reset by themselves, or terminations ignored, an end within the chunk stands in its last column, else
    in that of its step. The last observation and infos of an env that ended are those of
    its next episode where envs are reset by themselves; `infos[-1]` then has `final_observation` and `final_info`.
    """

    obs: list[dict[str, Any]]
    rewards: Array
    terminations: Array
    truncations: Array
    infos: list[dict[str, Any]]


class ChunkEnv:
    """A batch of envs with RLinf's `reset`, `step` and `chunk_step`; arrays are numpy's.

    An env that ended within a chunk waits for its end: it is no longer stepped, and earns nothing.
    """

    def __init__(
        self, env: TaskEnv, *, auto_reset: bool = True, ignore_terminations: bool = False, privileged: bool = False
    ) -> None:
        """Adopt an env, which `close` closes.

        Args:
            env: a batch of any size.
            auto_reset: reset envs that ended, at the end of a step or of a chunk.
            ignore_terminations: episodes that succeed or fail are reported as neither, though they do end there.
            privileged: show the group of observations that only a simulator knows.
        """
        self.env, self.num_envs = env, env.num_envs
        self.auto_reset, self.ignore_terminations = auto_reset, ignore_terminations
        self._hidden = () if privileged else (PRIVILEGED,)
        self._waiting = np.ones(self.num_envs, dtype=bool)
        self._returns = np.zeros(self.num_envs)

    def reset(
        self, *, seed: int | Sequence[int] | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin episodes, in all envs or in those of `options["env_idx"]`; a seed is of all, or one of each of them.

        Raises:
            TaskError: there is no such env, or another number of seeds.
        """
        unknown = set(options or {}) - {"env_idx"}
        if unknown:
            raise TaskError(f"reset takes the option env_idx, got {sorted(unknown)}")
        mask = np.ones(self.num_envs, dtype=bool)
        chosen = (options or {}).get("env_idx")
        if chosen is not None:
            rows = np.asarray(chosen)
            if rows.dtype.kind not in "iu" or (rows.size and not 0 <= rows.min() <= rows.max() < self.num_envs):
                raise TaskError(f"env_idx are numbers of envs from 0 to {self.num_envs - 1}, got {chosen}")
            mask = np.zeros(self.num_envs, dtype=bool)
            mask[rows] = True
        if mask.any():
            self.env.reset(seed=seed, mask=mask)
        self._waiting[mask], self._returns[mask] = False, 0.0
        return self._seen(), self._infos()

    def step(self, actions: Any, auto_reset: bool = True) -> SingleStep:
        """One control step of all envs that have not ended, by actions (N, A)."""
        given = numbers("actions", actions, TaskError)
        if given.shape != (self.num_envs, self.env.action_dim):
            raise TaskError(f"actions are ({self.num_envs}, {self.env.action_dim}), got {given.shape}")
        stepped = ~self._waiting
        rewards = np.zeros(self.num_envs)
        terminations, truncations = np.zeros((2, self.num_envs), dtype=bool)
        if stepped.any():
            result = self.env.step(given, None if stepped.all() else stepped)
            rewards[stepped] = result.reward[stepped]
            ended = (result.status == Status.SUCCESS) | (result.status == Status.FAILED)
            terminations, truncations = stepped & ended, stepped & (result.status == Status.TRUNCATED)
        self._returns += rewards
        done = terminations | truncations
        self._waiting |= done
        obs, infos = self._seen(), self._infos()
        if self.ignore_terminations:
            truncations, terminations = truncations | terminations, np.zeros_like(terminations)
        if auto_reset and self.auto_reset and done.any():
            obs, infos = self._next(done, obs, infos)
        return SingleStep(obs, rewards, terminations, truncations, infos)

    def chunk_step(self, chunk_actions: Any) -> Chunk:
        """K control steps of all envs, by actions (N, K, A)."""
        given = numbers("chunk_actions", chunk_actions, TaskError)
        shape = (self.num_envs, given.shape[1] if given.ndim == 3 else 0, self.env.action_dim)
        if given.shape != shape or not shape[1]:
            raise TaskError(f"chunk_actions are ({self.num_envs}, K, {self.env.action_dim}), got {given.shape}")
        steps = [self.step(given[:, k], auto_reset=False) for k in range(shape[1])]
        obs, infos = [step.obs for step in steps], [step.infos for step in steps]
        terminations = np.stack([step.terminations for step in steps], axis=1)
        truncations = np.stack([step.truncations for step in steps], axis=1)
        done = np.any(terminations | truncations, axis=1)
        if self.auto_reset or self.ignore_terminations:
            terminations, truncations = _last(terminations), _last(truncations)
        if self.auto_reset and done.any():
            obs[-1], infos[-1] = self._next(done, obs[-1], infos[-1])
        return Chunk(obs, np.stack([step.rewards for step in steps], axis=1), terminations, truncations, infos)

    def _next(self, done: Array, obs: dict[str, Any], infos: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin the next episodes of envs that ended."""
        fresh, about = self.reset(options={"env_idx": np.flatnonzero(done)})
        final = {"final_observation": obs, "final_info": infos}
        return fresh, about | final | {f"_{key}": done.copy() for key in (*final, "elapsed_steps")}

    def _seen(self) -> dict[str, Any]:
        """What a policy sees: each group and image (N, …), and the instructions under `task_descriptions`."""
        obs: Obs = self.env.obs
        seen: dict[str, Any] = {name: rows.copy() for name, rows in obs.items() if name not in self._hidden}
        return seen | {"task_descriptions": [self.env.instruction(i) for i in range(self.num_envs)]}

    def _infos(self) -> dict[str, Any]:
        """Success, steps and returns of the episodes so far."""
        info = {key: rows.copy() for key, rows in self.env.info.items()}
        episode = {
            "return": self._returns.copy(),
            "episode_len": info["elapsed_steps"],
            "success_once": info["is_success"],
        }
        return info | {"success": info["is_success"], "episode": episode}

    def close(self) -> None:
        self.env.close()


def _last(ends: Array) -> Array:
    """Ends (N, K) with those of all columns in the last one."""
    found = np.zeros_like(ends)
    found[:, -1] = ends.any(axis=1)
    return found

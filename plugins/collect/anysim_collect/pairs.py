"""Matched pairs: the same episode twice, with one factor or a few changed in the second, as trajectories of one run.

Of two envs the first runs episodes as they are, the second with the factors; both from the same seeds, so every other
draw is the same, noise of sensors and cameras included. Several such twos may run side by side: pair `p` is of the two
`p % K` of K, whose episode `p // K` it is. The first names the factors too, with the values that it has: some engines
build a scene anew where a value is written, and both do so then.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from anysim.conventions import Array
from anysim.randomization.draw import is_random
from anysim.randomization.streams import episode_seed
from anysim.record.names import EPISODES, MANIFEST_FILE, trajectory_name
from anysim.record.reader import open_trajectory
from anysim.task.env import TaskEnv
from anysim_recording.collector import Collector, Policy

SAME, CHANGED = 0, 1
"""The members of a pair: env 2k and 2k + 1."""
Actions = Literal["policy", "same"]


class PairCollector(Collector):
    """Collects `members` (0: as they are, 1: changed) of the first `pairs` pairs."""

    def __init__(
        self,
        env: TaskEnv,
        policy: Policy,
        out: Path,
        pairs: int,
        seed: int,
        factors: Mapping[str, Any],
        members: tuple[int, ...] = (SAME, CHANGED),
    ) -> None:
        """`env` has two envs for each pair that is run at once; `factors` are values by path."""
        super().__init__(env, policy, out, 2 * pairs, seed)
        self._factors, self._twos = factors, env.num_envs // 2
        counts = [len(range(two, pairs, self._twos)) for two in range(self._twos)]
        self._share = np.array([counts[i // 2] if i % 2 in members else 0 for i in range(env.num_envs)])

    def _reset(self, begin: Array, again: Array) -> None:
        """Begin the episodes that these envs have come to, each from the seed that both of its pair have."""
        del again  # the seed of an episode that is begun anew is what it was
        self._again.clear()
        ids = np.flatnonzero(begin)
        seeds = {int(i): episode_seed(self.seed, 0, int(self._episode[i]) * self._twos + int(i) // 2) for i in ids}
        first = begin & (np.arange(len(begin)) % 2 == SAME)
        if first.any():  # what they have is known when it has been drawn
            self.env.reset(mask=first, episode_seeds=[seeds[int(i)] for i in np.flatnonzero(first)])
        plan = [self._factors if i % 2 == CHANGED else present_values(self.env, int(i), self._factors) for i in ids]
        self.env.reset(mask=begin, episode_seeds=list(seeds.values()), overrides=plan)


def present_values(env: TaskEnv, index: int, factors: Mapping[str, Any]) -> dict[str, Any]:
    """The values that an env has in its episode at the paths of factors; one that has several there is left out."""
    found: dict[str, Any] = {}
    for path in factors:
        entry = env.counterfactuals.paths[path.removeprefix("world.")]
        origins = env.streams.origins[index]
        drawn = [env.streams.draws[index][name] for name, origin in origins.items() if origin.source == entry.source]
        value = getattr(entry.holder, entry.key) if not drawn else drawn[0] if len(drawn) == 1 else None
        if value is not None and not is_random(value):
            found[path] = value
    return found


class Tape:
    """A policy that gives the changed members the actions of the others, as they are recorded."""

    name = "tape"

    def __init__(self, env: TaskEnv, out: Path) -> None:
        self._env, self._out = env, out
        self._seeds: dict[int, Path] = {}
        for path in sorted((out / EPISODES).glob(f"env_*_episode_*/{MANIFEST_FILE}")):
            manifest = open_trajectory(path.parent).manifest
            if manifest.env % 2 == SAME:
                self._seeds[manifest.episode_seed] = path.parent
        self._actions = [np.zeros((0, env.action_dim))] * env.num_envs
        self._step = np.zeros(env.num_envs, dtype=int)

    def begin(self, env_ids: Array) -> None:
        """Take up the tapes of the episodes that have begun; that of one which was not kept is empty."""
        for i in env_ids.tolist():
            path = self._seeds.get(int(self._env.streams.episode_seed[i]))
            empty = np.zeros((0, self._env.action_dim))
            self._actions[i] = empty if path is None else open_trajectory(path).actions
            self._step[i] = 0

    def act(self, env_ids: Array) -> Array:
        """(N, A)."""
        action = np.clip(np.zeros((self._env.num_envs, self._env.action_dim)), *self._env.action_bounds)
        for i in env_ids.tolist():
            if self._step[i] < len(self._actions[i]):
                action[i] = self._actions[i][self._step[i]]
            self._step[i] += 1
        return action

    def gave_up(self, env_ids: Array) -> Array:
        """(n,) bool: the tape is at its end."""
        return np.array([self._step[i] >= len(self._actions[i]) for i in env_ids.tolist()], dtype=bool)

    def solved(self, env_ids: Array) -> Array:
        """(n,) bool: never by itself; the task says."""
        return np.zeros(len(env_ids), dtype=bool)

    def describe(self, env: int) -> dict[str, Any]:
        """Whose actions these are."""
        del env
        return {"skill": "tape"}

    def ended(self, env: int, success: bool) -> dict[str, Any]:
        """How the tape ended."""
        del env
        return {"skill": "tape", "outcome": "ok" if success else "tape_ended"}


def member(out: Path, which: int, pair: int, at_once: int) -> Path:
    """The trajectory of a member of a pair, whether it is there or not."""
    return out / EPISODES / trajectory_name(2 * (pair % at_once) + which, pair // at_once)

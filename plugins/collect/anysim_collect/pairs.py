"""Matched pairs: the same episode twice, with one factor or a few changed in the second, as trajectories of one run.

Env 0 runs the episodes as they are, env 1 with the factors; both from the same seeds, so every other draw is the
same, noise of sensors and cameras included. The first names the factors too, with the values that it has: some engines
build a scene anew where a value is written, and both do so then.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from anysim.conventions import Array
from anysim.randomization.draw import is_random
from anysim.randomization.streams import episode_seed
from anysim.record.collector import Collector, Policy
from anysim.record.names import EPISODES, MANIFEST_FILE, trajectory_name
from anysim.record.reader import open_trajectory
from anysim.task.env import TaskEnv

SAME, CHANGED = 0, 1
"""The envs of a pair."""
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
        """`env` has two envs; `factors` are values by path."""
        super().__init__(env, policy, out, 2 * pairs, seed)
        self._factors = factors
        self._share = np.array([pairs if member in members else 0 for member in (SAME, CHANGED)])

    def _reset(self, begin: Array, again: Array) -> None:
        """Begin the episodes that these envs have come to, each from the seed that both of its pair have."""
        del again  # the seed of an episode that is begun anew is what it was
        self._again.clear()
        ids = np.flatnonzero(begin)
        seeds = [episode_seed(self.seed, 0, int(self._episode[i])) for i in ids]
        if begin[SAME]:  # what it has is known when it has been drawn
            first = np.arange(2) == SAME
            self.env.reset(mask=first, episode_seeds=[episode_seed(self.seed, 0, int(self._episode[SAME]))])
        plan = [self._factors if i == CHANGED else present_values(self.env, SAME, self._factors) for i in ids]
        self.env.reset(mask=begin, episode_seeds=seeds, overrides=plan)


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
    """A policy that gives the changed member the actions of the other, as they are recorded."""

    name = "tape"

    def __init__(self, env: TaskEnv, out: Path) -> None:
        self._env, self._out = env, out
        self._seeds: dict[int, Path] = {}
        for path in sorted((out / EPISODES).glob(f"env_{SAME:04d}_episode_*/{MANIFEST_FILE}")):
            self._seeds[open_trajectory(path.parent).manifest.episode_seed] = path.parent
        self._actions = np.zeros((0, env.action_dim))
        self._step = 0

    def begin(self, env_ids: Array) -> None:
        """Take up the tape of the episode that has begun; that of one which was not kept is empty."""
        del env_ids
        path = self._seeds.get(int(self._env.streams.episode_seed[CHANGED]))
        self._actions = np.zeros((0, self._env.action_dim)) if path is None else open_trajectory(path).actions
        self._step = 0

    def act(self, env_ids: Array) -> Array:
        """(2, A)."""
        del env_ids
        action = np.clip(np.zeros((2, self._env.action_dim)), *self._env.action_bounds)
        if self._step < len(self._actions):
            action[CHANGED] = self._actions[self._step]
        self._step += 1
        return action

    def gave_up(self, env_ids: Array) -> Array:
        """(n,) bool: the tape is at its end."""
        return np.full(len(env_ids), self._step >= len(self._actions))

    def solved(self, env_ids: Array) -> Array:
        """(n,) bool: never by itself; the task says."""
        return np.zeros(len(env_ids), dtype=bool)

    def describe(self, env: int) -> dict[str, Any]:
        """Whose actions these are."""
        del env
        return {"skill": "tape"}

    def ended(self, env: int, success: bool) -> dict[str, Any]:
        """How the tape ended."""
        return {"skill": "tape", "outcome": "ok" if success else "tape_ended"}


def member(out: Path, which: int, episode: int) -> Path:
    """The trajectory of a member of a pair, whether it is there or not."""
    return out / EPISODES / trajectory_name(which, episode)

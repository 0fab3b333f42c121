"""A small model of the contract of TaskEnv, which says what any program of calls must come to.

An env's episode is a function of its episode seed and its actions alone. So what env 2 of four shows after resets,
steps and snapshots in any order is what an env that is all alone shows at the same step of the same episode. `Alone`
runs such an env, once for each episode; a `Row` keeps for an env which episode it is in, and where.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from anysim.randomization.streams import episode_seed
from anysim.task.env import TaskEnv

STATE = ("body_pose", "body_twist", "joint_pos", "joint_vel")


def action(seed: int, step: int, size: int) -> np.ndarray:
    """The action (A,) that is taken in a step of an episode, on whatever engine."""
    return np.sin(1.7 * np.arange(1, size + 1) * step + (seed % 1000))


class Moment(NamedTuple):
    """One env at one step of an episode."""

    obs: dict[str, bytes]
    state: dict[str, bytes]
    reward: bytes
    status: str
    draws: dict[str, Any]


def moment(env: TaskEnv, row: int, reward: Any) -> Moment:
    state = env.engine.get_state()
    return Moment(
        {group: rows[row].tobytes() for group, rows in env.obs.items()},
        {name: getattr(state, name)[row].tobytes() for name in STATE},
        np.float32(reward).tobytes(),
        str(env.status[row]),
        dict(env.streams.draws[row]),
    )


class Alone:
    """Episodes of an env that is alone on its engine, by seed."""

    def __init__(self, env: TaskEnv) -> None:
        assert env.num_envs == 1
        self.env = env
        self._episodes: dict[int, list[Moment]] = {}

    def at(self, seed: int, step: int) -> Moment:
        """What there is to see after `step` steps of an episode."""
        if seed not in self._episodes:
            env = self.env
            env.reset(episode_seeds=[seed])
            seen = [moment(env, 0, 0.0)]
            while env.running[0]:
                result = env.step(action(seed, len(seen) - 1, env.action_dim)[None])
                seen.append(moment(env, 0, result.reward[0]))
            self._episodes[seed] = seen
        return self._episodes[seed][step]


@dataclass(frozen=True)
class Row:
    """One env: its global seed and slot, how many episodes it has begun, and where it is."""

    seed: int
    slot: int
    begun: int = 0
    episode: int = 0
    step: int = 0
    status: str = "truncated"

    @property
    def running(self) -> bool:
        return self.status == "running"

    def reset(self) -> "Row":
        drawn = episode_seed(self.seed, self.slot, self.begun)
        return Row(self.seed, self.slot, self.begun + 1, drawn, 0, "running")

    def stepped(self, alone: Alone) -> "Row":
        after = self.step + 1
        return Row(self.seed, self.slot, self.begun, self.episode, after, alone.at(self.episode, after).status)

    def retired(self) -> "Row":
        status = "truncated" if self.running else self.status
        return Row(self.seed, self.slot, self.begun, self.episode, self.step, status)


def check(env: TaskEnv, rows: list[Row], alone: Alone, what: str) -> None:
    """Everything that shows, of every env, is what the model says."""
    for i, row in enumerate(rows):
        wanted, found = alone.at(row.episode, row.step), moment(env, i, 0.0)
        where = f"{what}: env {i}, step {row.step} of episode {row.episode}"
        assert found.obs == wanted.obs, f"{where}: another observation"
        assert found.state == wanted.state, f"{where}: another state"
        assert found.draws == wanted.draws, f"{where}: other draws"
        assert found.status == row.status, f"{where}: {found.status}, not {row.status}"
    info = env.info
    assert info["elapsed_steps"].tolist() == [row.step for row in rows], what
    assert info["episode_seed"].tolist() == [row.episode for row in rows], what
    assert env.running.tolist() == [row.running for row in rows], what

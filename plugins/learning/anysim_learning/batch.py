"""A batch of envs as learners want it: an env whose episode ends begins the next one in the same step."""

from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.task.contract import Status
from anysim.task.env import TaskEnv
from anysim.task.snapshot import EnvSnapshot

POLICY = "policy"
"""The group of observations that every policy may see."""


RECENT = 100
"""Episodes over which success, reward and steps are averaged."""


class EpisodeEnd(NamedTuple):
    """An episode that has ended in a step.

    Attributes:
        env: where.
        status: success, failed, truncated or fault.
        obs: its last observations by group, rows (D,).
        total_reward: the sum of its rewards.
        steps: control steps.
    """

    env: int
    status: str
    obs: dict[str, Array]
    total_reward: float
    steps: int


class Moment(NamedTuple):
    """What a step of the batch gave.

    Attributes:
        obs: observations by group (N, D) float32; of envs whose episode has ended, the first ones of the next.
        reward: (N,) float32; 0 where the simulation gave up on an env.
        done: (N,) bool, episodes that have ended, for whatever reason.
        truncated: (N,) bool, those of them that only ran out of time, or whose simulation gave up. Success in the last
            step that there is ended nothing either: such a task goes on for as long as it may.
        ended: these episodes.
    """

    obs: dict[str, Array]
    reward: Array
    done: Array
    truncated: Array
    ended: tuple[EpisodeEnd, ...]


def action_range(env: TaskEnv) -> tuple[Array, Array]:
    """The middle and half of the range of each action (A,), in the units of the env.

    Raises:
        TaskError: there is no action, or one has no bounds.
    """
    if env.action_dim == 0:
        raise TaskError(f"'{env.name}' has no actions, so nothing can be learnt; give a robot `actions` in its world")
    low, high = (np.asarray(bound, dtype=np.float64) for bound in env.action_bounds)
    if not (np.isfinite(low) & np.isfinite(high)).all():
        raise TaskError(f"the actions of '{env.name}' have no bounds, which learners need: bound its controllers")
    return (low + high) / 2, (high - low) / 2


class Batch:
    """Envs that begin their next episode in the step that ends one.

    Actions are in [-1, 1], which stand for the bounds of the env's.

    Attributes:
        middle, half: (A,) of the bounds of the env's actions.
        recent: the last episodes that have ended.
    """

    def __init__(self, env: TaskEnv, groups: Sequence[str] = (POLICY,)) -> None:
        """`groups` are the observation groups that are given out.

        Raises:
            TaskError: the task has no such group.
        """
        for group in groups:
            if group not in env.observation_sizes:
                raise TaskError(
                    f"the task '{env.name}' has no observation group '{group}' (groups: "
                    f"{listing(env.observation_sizes)}); add it under task.observations"
                )
        self.env, self.groups = env, tuple(groups)
        self.sizes = {group: env.observation_sizes[group] for group in groups}
        self.middle, self.half = action_range(env)
        self.recent: deque[EpisodeEnd] = deque(maxlen=RECENT)
        self._total = np.zeros(env.num_envs)
        self._horizon = np.inf if env.spec.task is None else env.spec.task.horizon

    def averages(self) -> dict[str, float]:
        """`reward`, `steps_per_episode` and `success` of recent episodes; nothing before the first has ended.

        Where envs climb levels of ground: their mean `level`, and `level/N`, the share of envs on each.
        """
        if not self.recent:
            return {}
        return {
            **self._levels(),
            "reward": float(np.mean([one.total_reward for one in self.recent])),
            "steps_per_episode": float(np.mean([one.steps for one in self.recent])),
            "success": float(np.mean([one.status == Status.SUCCESS for one in self.recent])),
        }

    def _levels(self) -> dict[str, float]:
        terrain = self.env.scene.terrain
        if terrain is None or not terrain.climbs:
            return {}
        shares = np.bincount(terrain.level, minlength=terrain.rows) / self.env.num_envs
        return {"level": float(terrain.level.mean()), **{f"level/{n}": float(v) for n, v in enumerate(shares)}}

    def reset(self, seed: int | None = None) -> dict[str, Array]:
        """Begin an episode in each env; the episodes to come follow from `seed`, or go on where it is None."""
        self.env.reset(seed=seed)
        self._total[:] = 0.0
        return self._obs()

    def state(self) -> dict[str, Any]:
        """What a checkpoint keeps: the file of a snapshot of the envs as bytes, and what `averages` are of."""
        with TemporaryDirectory() as folder:
            file = self.env.snapshot().save(Path(folder) / "envs").read_bytes()
        ended = [[one.env, one.status, one.total_reward, one.steps] for one in self.recent]
        return {"envs": np.frombuffer(file, dtype=np.uint8), "total": self._total.copy(), "recent": ended}

    def restore(self, state: Mapping[str, Any]) -> dict[str, Array]:
        """Go on from there, as if it had not been put away; returns the observations, as `reset` does."""
        with TemporaryDirectory() as folder:
            (Path(folder) / "envs").write_bytes(state["envs"].tobytes())
            snapshot = EnvSnapshot.load(Path(folder) / "envs")
        self.env.reset(seed=0)
        self.env.reset_to(snapshot)
        self._total[:] = state["total"]
        self.recent.clear()
        self.recent += [EpisodeEnd(env, status, {}, *rest) for env, status, *rest in state["recent"]]
        return self._obs()

    def step(self, action: Array) -> Moment:
        """One control step of all envs with actions (N, A) in [-1, 1]; what is beyond is cut off."""
        env = self.env
        unit = np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        result = env.step(self.middle + self.half * unit)
        fault = env.info["fault"]
        reward = np.where(fault, 0.0, result.reward)
        self._total += reward
        done = result.status != Status.RUNNING
        last_step = env.scene.elapsed >= self._horizon
        truncated = done & ((result.status == Status.TRUNCATED) | fault | last_step & (result.status == Status.SUCCESS))
        ended: tuple[EpisodeEnd, ...] = ()
        if done.any():
            last = self._obs()
            ended = tuple(
                EpisodeEnd(
                    i,
                    "fault" if fault[i] else str(result.status[i]),
                    {group: rows[i] for group, rows in last.items()},
                    float(self._total[i]),
                    int(env.scene.elapsed[i]),
                )
                for i in np.flatnonzero(done).tolist()
            )
            self.recent += ended
            env.reset(mask=done)
            self._total[done] = 0.0
        return Moment(self._obs(), reward.astype(np.float32), done, truncated, ended)

    def _obs(self) -> dict[str, Array]:
        obs = self.env.obs
        return {group: np.nan_to_num(obs[group]) for group in self.groups}

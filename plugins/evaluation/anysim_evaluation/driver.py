"""The driver: episodes with fixed seeds, run in as many envs as there are. Each free env begins the next episode."""

from collections import Counter, deque
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.task.contract import Status
from anysim.task.env import TaskEnv
from anysim_evaluation.policy import Judging, Policy, Striving

SPLITS = {"train": range(10_000), "validation": range(10_000, 10_200), "test": range(20_000, 20_200)}
"""Episode seeds by split. Nothing is tuned on those of `test`."""

RERUNS = 3
"""How often an episode is begun anew whose worker process is lost, before that ends the evaluation."""

FAULT = "fault"
"""The status of an episode that the simulation ended: neither a success nor a failure of the policy."""


def episode_seeds(split: str, first: int, episodes: int) -> list[int]:
    """The seeds of `episodes` episodes of a split from its place `first` on.

    Raises:
        TaskError: there is no such split, or it ends before.
    """
    if split not in SPLITS:
        raise TaskError(f"--split {split}: expected one of {', '.join(SPLITS)}")
    seeds = SPLITS[split][first : first + episodes]
    if len(seeds) < episodes:
        raise TaskError(
            f"the split '{split}' has {len(SPLITS[split])} seeds, too few for {episodes} episodes from its place "
            f"{first} (--seed) on"
        )
    return list(seeds)


@dataclass(frozen=True)
class Episode:
    """How an episode came out.

    Attributes:
        seed: what it was drawn from.
        status: success, failed, truncated or fault.
        failure: the type of a failure, in a word; empty for a success.
        steps: control steps.
        total_reward: the sum of its rewards.
        sim_s: simulated [s].
        retries: how often the policy tried again; None where it cannot say.
        done: commands of the task that are done; None where it has none, or the policy cannot say.
        required: those that there are.
        ground: the kind of its tile, as `stairs down`; None where the ground has no tiles.
        ground_level: the row of its tile, 0 the easiest; None as well.
    """

    seed: int
    status: str
    failure: str
    steps: int
    total_reward: float
    sim_s: float = 0.0
    retries: int | None = None
    done: int | None = None
    required: int | None = None
    ground: str | None = None
    ground_level: int | None = None


def drive(
    env: TaskEnv,
    policy: Policy,
    seeds: Sequence[int],
    *,
    privileged: bool = False,
    groups: Collection[str] | None = None,
) -> Iterator[Episode]:
    """Run an episode of each seed, and yield it when it has ended.

    Which episodes these are, and how they come out, depends neither on the number of envs nor on the order. The policy
    is shown the groups of observations `groups`, all where not given; the group `privileged` only if asked for.

    Raises:
        TaskError: the policy gives something else than actions, or an episode loses its worker again and again.
    """
    waiting, begun = deque(seeds), Counter[int]()
    total = np.zeros(env.num_envs)
    chunks: list[Array] = [np.zeros((0, env.action_dim))] * env.num_envs
    action = np.tile(np.clip(np.zeros(env.action_dim), *env.action_bounds), (env.num_envs, 1))
    judging = policy if isinstance(policy, Judging) else None
    striving = policy if isinstance(policy, Striving) else None
    control_dt = env.engine.world.physics.control_dt

    def shown(group: str) -> bool:
        return privileged if group == "privileged" else groups is None or group in groups

    def begin(free: Array) -> None:
        ids = free[: len(waiting)]
        if len(ids) == 0:
            return
        mask = np.zeros(env.num_envs, dtype=bool)
        mask[ids] = True
        ids = np.flatnonzero(mask)
        taken = [waiting.popleft() for _ in ids]
        begun.update(taken)
        env.reset(mask=mask, episode_seeds=taken)
        policy.reset(ids)
        total[ids] = 0.0
        for i in ids.tolist():
            chunks[i] = chunks[i][:0]

    begin(np.arange(env.num_envs))
    while (active := env.running).any():
        ids = np.flatnonzero(active)
        asked = np.array([i for i in ids.tolist() if len(chunks[i]) == 0], dtype=int)
        if len(asked):
            obs = {group: rows[asked] for group, rows in env.obs.items() if shown(group)}
            given = _chunks(policy.act(obs, asked), len(asked), env.action_dim)
            for i, chunk in zip(asked.tolist(), given, strict=True):
                chunks[i] = chunk
        for i in ids.tolist():
            action[i], chunks[i] = chunks[i][0], chunks[i][1:]
        result = env.step(action, None if active.all() else active)
        total[ids] += result.reward[ids]
        running = result.status[ids] == Status.RUNNING
        solved = np.zeros(len(ids), dtype=bool) if judging is None else running & judging.solved(ids)
        given_up = np.zeros(len(ids), dtype=bool) if judging is None else judging.gave_up(ids)
        over = ids[~running | solved | given_up]
        won = set(ids[solved].tolist())
        faults, lost = env.info["fault"], env.engine.lost
        for i in over.tolist():
            seed = int(env.streams.episode_seed[i])
            if faults[i] and lost[i]:
                if begun[seed] > RERUNS:
                    raise TaskError(f"the episode of seed {seed} lost its worker process {begun[seed]} times")
                waiting.appendleft(seed)
                continue
            status = str(Status.SUCCESS if i in won else result.status[i])
            status = FAULT if faults[i] else str(Status.FAILED) if status == Status.RUNNING else status
            why = "" if judging is None else judging.failure(i)
            failure = "" if status == Status.SUCCESS else FAULT if faults[i] else why or status
            steps = int(env.scene.elapsed[i])
            told = (None, None, None) if striving is None else striving.effort(i, status == Status.SUCCESS)
            where = ground(env, i)
            yield Episode(seed, status, failure, steps, float(total[i]), round(steps * control_dt, 6), *told, *where)
        env.retire(over)
        begin(over)


def ground(env: TaskEnv, i: int) -> tuple[str, int] | tuple[None, None]:
    """The kind and the row of the tile that an env stands on."""
    terrain, spec = env.scene.terrain, env.spec.world.terrain
    if terrain is None or not terrain.tiled:
        return None, None
    column = spec.tiling.columns[terrain.column[i]]
    return f"{column.kind} down" if column.down else column.kind, int(terrain.level[i])


def _chunks(given: Array, rows: int, dim: int) -> Array:
    """Actions as chunks (n, K, A)."""
    given = np.asarray(given)
    chunks = given[:, None] if given.ndim == 2 else given
    if chunks.ndim != 3 or chunks.shape[0] != rows or chunks.shape[1] == 0 or chunks.shape[2] != dim:
        raise TaskError(f"the policy gave {given.shape}; expected actions ({rows}, {dim}) or chunks ({rows}, K, {dim})")
    return chunks

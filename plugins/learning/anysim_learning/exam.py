"""Exams of a policy while it learns: its success and reward without noise, in episodes of the validation split."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch  # pyright: ignore[reportMissingImports]

from anysim.conventions import Array
from anysim.task.contract import Status
from anysim.task.env import TaskEnv

FIRST = 10_000
"""The first seed of the validation split, as `anysim evaluate` has it."""


class Mark(NamedTuple):
    """What came of an exam; the better of two is the greater, so rewards decide where as many are solved.

    Attributes:
        success: the share of episodes that are solved.
        reward: the sum of an episode's rewards, in the mean.
    """

    success: float
    reward: float


def exam(env: TaskEnv, groups: Sequence[str], network: torch.nn.Module) -> Mark:
    """How a policy does in one episode in each env, of the first seeds of the validation split.

    `groups` are its inputs in order: observation groups and images.
    """
    network.eval()
    env.reset(episode_seeds=list(range(FIRST, FIRST + env.num_envs)))
    chunk, total = np.zeros((env.num_envs, 0, env.action_dim)), np.zeros(env.num_envs)
    while (active := env.running).any():
        if chunk.shape[1] == 0:
            chunk = _acted(network, [env.obs[group] for group in groups])
        action, chunk = chunk[:, 0], chunk[:, 1:]
        reward = env.step(action, None if active.all() else active).reward
        total += np.where(active & ~env.info["fault"], reward, 0.0)
        env.retire(np.flatnonzero(active & (env.status != Status.RUNNING)))
    return Mark(float((env.status == Status.SUCCESS).mean()), float(total.mean()))


def _acted(network: torch.nn.Module, rows: Sequence[Array]) -> Array:
    """Chunks (n, K, A) for rows of observation groups and images."""
    seen = [row if row.dtype == np.uint8 else np.nan_to_num(row).astype(np.float32) for row in rows]
    with torch.inference_mode():
        given = network(*(torch.as_tensor(row) for row in seen)).double().numpy()
    return given[:, None] if given.ndim == 2 else given

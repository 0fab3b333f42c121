"""Exams of a policy while it learns: its success without noise, in episodes of the validation split."""

from collections.abc import Sequence

import numpy as np
import torch  # pyright: ignore[reportMissingImports]

from anysim.conventions import Array
from anysim.task.contract import Status
from anysim.task.env import TaskEnv

FIRST = 10_000
"""The first seed of the validation split, as `anysim evaluate` has it."""


def exam(env: TaskEnv, groups: Sequence[str], network: torch.nn.Module) -> float:
    """The share of episodes that a policy solves: one in each env, of the first seeds of the validation split.

    `groups` are its inputs in order: observation groups and images.
    """
    network.eval()
    env.reset(episode_seeds=list(range(FIRST, FIRST + env.num_envs)))
    chunk = np.zeros((env.num_envs, 0, env.action_dim))
    while (active := env.running).any():
        if chunk.shape[1] == 0:
            chunk = _acted(network, [env.obs[group] for group in groups])
        action, chunk = chunk[:, 0], chunk[:, 1:]
        env.step(action, None if active.all() else active)
        env.retire(np.flatnonzero(active & (env.status != Status.RUNNING)))
    return float((env.status == Status.SUCCESS).mean())


def _acted(network: torch.nn.Module, rows: Sequence[Array]) -> Array:
    """Chunks (n, K, A) for rows of observation groups and images."""
    seen = [row if row.dtype == np.uint8 else np.nan_to_num(row).astype(np.float32) for row in rows]
    with torch.inference_mode():
        given = network(*(torch.as_tensor(row) for row in seen)).double().numpy()
    return given[:, None] if given.ndim == 2 else given

"""Recorded runs as a dataset: for each control step what was observed before it, and the actions from it on."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.record.names import EPISODES
from anysim.record.reader import open_trajectory


class Demonstration(NamedTuple):
    """A trajectory of T steps.

    Attributes:
        obs: (T, D) float32 by group: what was observed before each action.
        action: (T, A) float32, in the units of the env.
    """

    obs: dict[str, Array]
    action: Array


class Demonstrations:
    """The successful trajectories of runs, in the order of their names.

    `data[i]` is the sample of one step: the observations (D,) by group, the chunk of actions (K, A) that followed, and
    the mask (K,) of those that there were. With `torch.utils.data.DataLoader` it is a dataset like any other.
    """

    def __init__(self, runs: Sequence[Path], groups: Sequence[str], chunk: int = 1) -> None:
        """Read them all into memory.

        Raises:
            TaskError: a run has no successful trajectory, or one was recorded without these observations.
            RecordError: a trajectory is damaged.
        """
        self.chunk = chunk
        self.trajectories: list[Demonstration] = []
        for run in runs:
            found = sorted(path for path in (run / EPISODES).glob("*") if path.is_dir())
            before = len(self.trajectories)
            self.trajectories += [one for path in found if (one := _read(path, groups)) is not None]
            if len(self.trajectories) == before:
                raise TaskError(f"{run} has no successful trajectory; expected a directory that `anysim run` wrote")
        if len({one.action.shape[1] for one in self.trajectories}) > 1:
            raise TaskError("the runs command different numbers of actions; clone one task of one robot at a time")
        lengths = [len(one.action) for one in self.trajectories]
        self._of = np.repeat(np.arange(len(lengths)), lengths)
        self._at = np.concatenate([np.arange(n) for n in lengths]) if lengths else np.zeros(0, dtype=int)

    def __len__(self) -> int:
        return len(self._of)

    def __getitem__(self, index: int) -> tuple[dict[str, Array], Array, Array]:
        one, at = self.trajectories[self._of[index]], int(self._at[index])
        chunk, mask = np.zeros((self.chunk, one.action.shape[1]), np.float32), np.zeros(self.chunk, np.float32)
        there = one.action[at : at + self.chunk]
        chunk[: len(there)], mask[: len(there)] = there, 1.0
        return {group: rows[at] for group, rows in one.obs.items()}, chunk, mask

    def arrays(self, chosen: Sequence[int] | None = None) -> tuple[dict[str, Array], Array, Array]:
        """All samples of some trajectories (all if not said) at once: observations, chunks (n, K, A), masks (n, K)."""
        wanted = np.arange(len(self.trajectories)) if chosen is None else np.asarray(chosen)
        samples = [self[i] for i in np.flatnonzero(np.isin(self._of, wanted)).tolist()]
        obs = {group: np.stack([sample[0][group] for sample in samples]) for group in self.trajectories[0].obs}
        return obs, np.stack([sample[1] for sample in samples]), np.stack([sample[2] for sample in samples])


def _read(path: Path, groups: Sequence[str]) -> Demonstration | None:
    """A successful trajectory; None of another."""
    reader = open_trajectory(path)
    if reader.manifest.status != "success":
        return None
    lacking = [group for group in groups if group not in reader.obs or group not in reader.initial_obs]
    if lacking:
        raise TaskError(f"{path} was recorded without the observations {', '.join(lacking)}; record it anew")
    obs = {
        group: np.nan_to_num(np.concatenate([reader.initial_obs[group][None], reader.obs[group][:-1]])).astype(
            np.float32
        )
        for group in groups
    }
    return Demonstration(obs, reader.actions.astype(np.float32))

"""Recorded runs as a dataset: for each control step what was observed before it, and the actions from it on."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.record.names import EPISODES
from anysim.record.reader import TrajectoryReader, open_trajectory

PREFIX = "images/"
"""What the names of images begin with; the camera follows."""


class Demonstration(NamedTuple):
    """A trajectory of T steps.

    Attributes:
        obs: (T, D) float32 by group: what was observed before each action.
        action: (T, A) float32, in the units of the env.
        images: (F, H, W, 3) uint8 by name, `images/CAMERA`: each image once.
        shown: (T,) by name: which of them was the latest before each action.
    """

    obs: dict[str, Array]
    action: Array
    images: dict[str, Array]
    shown: dict[str, Array]


class Demonstrations:
    """The successful trajectories of runs, in the order of their names.

    `data[i]` is the sample of one step: the observations (D,) by group and images (H, W, 3) uint8 by name, the chunk of
    actions (K, A) that followed, and the mask (K,) of those that there were. With `torch.utils.data.DataLoader` it is a
    dataset like any other.
    """

    def __init__(
        self,
        runs: Sequence[Path],
        groups: Sequence[str],
        chunk: int = 1,
        *,
        images: Sequence[str] = (),
        prepare: Callable[[Array], Array] | None = None,
    ) -> None:
        """Read them all into memory.

        Args:
            runs: directories that `anysim run` wrote.
            groups: observation groups.
            chunk: the actions K of a sample.
            images: names of recorded images, as `images/front` for those of the camera `front`.
            prepare: makes of a trajectory's images (F, H, W, 3) uint8 those that are kept, such as smaller ones.

        Raises:
            TaskError: a run has no successful trajectory, or one was recorded without these observations or images.
            RecordError: a trajectory is damaged.
        """
        self.chunk = chunk
        self.trajectories: list[Demonstration] = []
        for run in runs:
            found = sorted(path for path in (run / EPISODES).glob("*") if path.is_dir())
            before = len(self.trajectories)
            self.trajectories += [one for path in found if (one := _read(path, groups, images, prepare)) is not None]
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
        seen = {name: rows[one.shown[name][at]] for name, rows in one.images.items()}
        return {group: rows[at] for group, rows in one.obs.items()} | seen, chunk, mask

    def arrays(self, chosen: Sequence[int] | None = None) -> tuple[dict[str, Array], Array, Array]:
        """All samples of some trajectories (all if not said) at once: observations, chunks (n, K, A), masks (n, K).

        Images are apart, in `frames`.
        """
        wanted = np.arange(len(self.trajectories)) if chosen is None else np.asarray(chosen)
        samples = [self[i] for i in np.flatnonzero(np.isin(self._of, wanted)).tolist()]
        obs = {group: np.stack([sample[0][group] for sample in samples]) for group in self.trajectories[0].obs}
        return obs, np.stack([sample[1] for sample in samples]), np.stack([sample[2] for sample in samples])

    def frames(self, chosen: Sequence[int]) -> dict[str, tuple[Array, Array]]:
        """Images (F, H, W, 3) uint8 of some trajectories by name, and which of them each sample has (n,)."""
        ones = [self.trajectories[k] for k in sorted(chosen)]
        found: dict[str, tuple[Array, Array]] = {}
        for name in ones[0].images:
            starts = np.cumsum([0, *(len(one.images[name]) for one in ones)])
            shown = [one.shown[name] + start for one, start in zip(ones, starts.tolist(), strict=False)]
            found[name] = np.concatenate([one.images[name] for one in ones]), np.concatenate(shown)
        return found


def _read(
    path: Path, groups: Sequence[str], images: Sequence[str], prepare: Callable[[Array], Array] | None
) -> Demonstration | None:
    """A successful trajectory; None of another."""
    reader = open_trajectory(path)
    if reader.manifest.status != "success":
        return None
    lacking = [group for group in groups if group not in reader.obs or group not in reader.initial_obs]
    if lacking:
        raise TaskError(f"{path} was recorded without the observations {', '.join(lacking)}; record it anew")
    obs = {group: np.nan_to_num(reader.obs_from_reset(group)[:-1]).astype(np.float32) for group in groups}
    pictures: dict[str, Array] = {}
    shown: dict[str, Array] = {}
    for name in images:
        frames, shown[name] = _images(reader, name)
        pictures[name] = frames if prepare is None else prepare(frames)
    return Demonstration(obs, reader.actions.astype(np.float32), pictures, shown)


def _images(reader: TrajectoryReader, name: str) -> tuple[Array, Array]:
    """The images (F, H, W, 3) uint8 of a camera, and which was the latest before each action (T,)."""
    camera = name.removeprefix(PREFIX)
    if camera not in reader.manifest.cameras or reader.manifest.cameras[camera].first_step != 0:
        raise TaskError(
            f"{reader.directory} was recorded without images of '{camera}' from the start (cameras: "
            f"{listing(reader.manifest.cameras)}); record it anew with record.cameras=[{camera}]"
        )
    steps, frames = zip(*reader.images(camera), strict=True)
    return np.stack(frames), np.searchsorted(np.array(steps), np.arange(reader.manifest.steps), side="right") - 1


def check_cameras(runs: Sequence[Path], shapes: Mapping[str, tuple[int, ...]], every: Mapping[str, int]) -> None:
    """See that runs show images as a task does.

    Args:
        runs: directories that `anysim run` wrote.
        shapes: of the task's images, by name.
        every: control steps from one image of the task to the next, by camera.

    Raises:
        TaskError: images of other sizes were recorded, or more or less often.
    """
    for run in runs:
        for path in sorted(path for path in (run / EPISODES).glob("*") if path.is_dir())[:1]:
            cameras = open_trajectory(path).manifest.cameras
            for name, shape in shapes.items():
                camera = name.removeprefix(PREFIX)
                entry = cameras.get(camera)
                if entry is not None and ((entry.height, entry.width, 3) != shape or entry.every != every[camera]):
                    raise TaskError(
                        f"{run} shows '{camera}' with {entry.width} x {entry.height} pixels in every {entry.every}. "
                        f"step; the task with {shape[1]} x {shape[0]} in every {every[camera]}.: set world.cameras."
                        f"{camera}.size and task.images.{camera}.fps as they were recorded"
                    )

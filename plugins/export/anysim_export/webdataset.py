"""Shards of webdataset: tar files in which the files of a sample follow one another and share a name."""

import io
import tarfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.record.json import dump_json
from anysim_export.api import DataSet, Episode, Exporter, png

PART_FILE = "episode.tar"


class WebDatasetExporter(Exporter):
    """A sample for each control step, in `shard-000000.tar` and on: `EPISODE_STEP.json`, `.npz`, and `.CAMERA.png`.

    The JSON has the episode, the step, the instruction and the skill, the arrays `obs_GROUP`, `action`, `reward` and
    `done`. Episodes are not split between shards, and every byte of a shard follows from the recording.
    """

    def __init__(
        self,
        *,
        images: Annotated[bool, Field(description="whether the images of cameras are in it")] = True,
        shard_mb: Annotated[int, Field(ge=1, description="of a shard, unless one episode is larger")] = 256,
    ) -> None:
        self._images, self._shard_mb = images, shard_mb

    def write_episode(self, folder: Path, episode: Episode, data: DataSet) -> None:
        """The samples of an episode as a tar file."""
        cameras = list(episode.manifest.cameras) if self._images else []
        pictures = {camera: episode.images(camera) for camera in cameras}
        with tarfile.open(folder / PART_FILE, "w", format=tarfile.USTAR_FORMAT) as tar:
            for t in range(episode.steps):
                sample = f"{episode.index:06d}_{t:06d}"
                about = {
                    "episode": episode.index,
                    "step": t,
                    "time": t * data.first.control_dt,
                    "instruction": episode.tasks[t],
                    "segment": episode.segments[t],
                    "episode_seed": str(episode.manifest.episode_seed),
                }
                _add(tar, f"{sample}.json", dump_json(about, "sample"))
                arrays = {f"obs_{name}": rows[t] for name, rows in episode.obs.items()}
                arrays |= {"action": episode.actions[t], "reward": episode.rewards[t]}
                arrays["done"] = np.array(t == episode.steps - 1)
                packed = io.BytesIO()
                np.savez(packed, allow_pickle=False, **arrays)
                _add(tar, f"{sample}.npz", packed.getvalue())
                for camera in cameras:
                    _add(tar, f"{sample}.{camera}.png", png(next(pictures[camera])))

    def assemble(self, folder: Path, parts: Sequence[Path], data: DataSet) -> None:
        """Whole episodes, as many as a shard holds."""
        most = self._shard_mb << 20
        with ExitStack() as stack:
            tar: tarfile.TarFile | None = None
            size = number = 0
            for part in parts:
                grows = (part / PART_FILE).stat().st_size
                if tar is None or (size and size + grows > most):
                    stack.close()
                    path = folder / f"shard-{number:06d}.tar"
                    tar = stack.enter_context(tarfile.open(path, "w", format=tarfile.USTAR_FORMAT))
                    size, number = 0, number + 1
                size += grows
                for name, content in _members(part / PART_FILE):
                    _add(tar, name, content)


def _add(tar: tarfile.TarFile, name: str, content: bytes) -> None:
    """A file without an owner and a time."""
    entry = tarfile.TarInfo(name)
    entry.size, entry.mode, entry.mtime = len(content), 0o644, 0
    tar.addfile(entry, io.BytesIO(content))


def _members(path: Path) -> Iterator[tuple[str, bytes]]:
    with tarfile.open(path, "r") as tar:
        for entry in tar:
            file = tar.extractfile(entry)
            assert file is not None
            yield entry.name, file.read()

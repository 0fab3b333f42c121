"""Shards of webdataset: tar files in which the files of a sample follow one another and share a name."""

import io
import tarfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.record.json import dump_json
from anysim_export.api import DataSet, Episode, Exporter, png
from anysim_export.streams import Channel, others_of

PART_FILE, CHANNELS_FILE = "episode.tar", "channels.json"
WORDS = ("text", "data")


class WebDatasetExporter(Exporter):
    """A sample for each control step, in `shard-000000.tar` and on: `EPISODE_STEP.json`, `.npz`, and `.CAMERA.png`.

    The JSON has the episode, the step, what came of the action, the instruction and what the policy said that it did,
    the arrays `obs_GROUP`, `action`, `reward` and `done`. `.CAMERA_depth.npz` has the array `depth` (H, W) float32 [m],
    `.CAMERA_segmentation.npz` `segmentation` (H, W) uint16, whose legend is in `channels.json`. Other streams, as
    annotations, are in the JSON or among the arrays by their names, as what was said last. Episodes are not split
    between shards, and every byte of a shard follows from the recording.
    """

    def __init__(
        self,
        *,
        images: Annotated[bool, Field(description="whether the images of cameras are in it")] = True,
        channels: Annotated[bool, Field(description="whether recorded depth and segmentation are in it")] = True,
        states: Annotated[bool, Field(description="whether the recorded states are in it")] = False,
        streams: Annotated[bool, Field(description="whether other recorded streams are in it, as annotations")] = True,
        shard_mb: Annotated[int, Field(ge=1, description="of a shard, unless one episode is larger")] = 256,
    ) -> None:
        self._images, self._channels, self._states, self._streams = images, channels, states, streams
        self._shard_mb = shard_mb

    def places(self, data: DataSet) -> Mapping[str, str]:
        """Keys of the JSON and of the arrays, and endings of files."""
        first = data.first
        found = {"action": "array `action`", "collect/reward": "array `reward`", "collect/status": "JSON `status`"}
        found |= {"annotation": "JSON `annotation`, `segment`", "language": "JSON `instruction`"}
        found |= {f"state/{name}": f"array `state_{name}`" for name in first.layout.state if self._states}
        found |= {f"observation/{name}": f"array `obs_{name}`" for name in first.layout.obs}
        found |= {f"camera/{name}": f"`.{name}.png`" for name in first.cameras if self._images}
        for name in self._others(data):
            words = first.streams[name].kind in WORDS
            found[name] = f"JSON `{name}`" if words else f"array `{name}`"
        return found | {one.stream: f"`.{one.key}.npz`" for one in self._pictures(data)}

    def _others(self, data: DataSet) -> tuple[str, ...]:
        return others_of(data.first) if self._streams else ()

    def _pictures(self, data: DataSet) -> tuple[Channel, ...]:
        return data.channels if self._channels else ()

    def write_episode(self, folder: Path, episode: Episode, data: DataSet) -> None:
        """The samples of an episode as a tar file."""
        cameras = list(episode.manifest.cameras) if self._images else []
        shown = {camera: episode.images(camera) for camera in cameras}
        pictures = [(one, episode.channel(one)) for one in self._pictures(data)]
        others = {name: episode.held(name) for name in self._others(data)}
        with tarfile.open(folder / PART_FILE, "w", format=tarfile.USTAR_FORMAT) as tar:
            for t in range(episode.steps):
                sample = f"{episode.index:06d}_{t:06d}"
                about = {
                    "episode": episode.index,
                    "step": t,
                    "time": t * data.first.control_dt,
                    "instruction": episode.tasks[t],
                    "segment": episode.segments[t],
                    "annotation": episode.annotations[t],
                    "status": episode.statuses[t],
                    "episode_seed": str(episode.manifest.episode_seed),
                }
                now = {name: next(values) for name, values in others.items()}
                arrays: dict[str, Any] = {name: value for name, value in now.items() if isinstance(value, np.ndarray)}
                about |= {name: value for name, value in now.items() if name not in arrays}
                _add(tar, f"{sample}.json", dump_json(about, "sample"))
                arrays |= {f"obs_{name}": rows[t] for name, rows in episode.obs.items()}
                arrays |= {"action": episode.actions[t], "reward": episode.rewards[t]}
                arrays["done"] = np.array(t == episode.steps - 1)
                arrays |= {f"state_{name}": rows[t] for name, rows in episode.states.items() if self._states}
                _add(tar, f"{sample}.npz", _packed(np.savez, arrays))
                for camera in cameras:
                    _add(tar, f"{sample}.{camera}.png", png(next(shown[camera])))
                for one, images in pictures:
                    content = _packed(np.savez_compressed, {one.name: next(images)})
                    _add(tar, f"{sample}.{one.key}.npz", content)

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
        if pictures := self._pictures(data):
            said = {one.key: one.about for one in pictures}
            (folder / CHANNELS_FILE).write_bytes(dump_json(said, "channels"))


def _packed(write: Callable[..., None], arrays: Mapping[str, Array]) -> bytes:
    content = io.BytesIO()
    write(content, allow_pickle=False, **arrays)
    return content.getvalue()


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

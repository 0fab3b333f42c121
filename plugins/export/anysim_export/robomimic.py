"""robomimic's HDF5: one file with a group of arrays for each demonstration (robomimic 0.3)."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim_export.api import DataSet, Episode, Exporter, refuse_shared
from anysim_export.hdf5_files import new_file
from anysim_export.streams import Channel

DEMO_FILE = "demo.hdf5"
GYM_TYPE = 2
"""robomimic's number of an env that is made through gymnasium."""


class RobomimicExporter(Exporter):
    """`demo.hdf5`: `data/demo_0`, … with actions, dones, rewards, states, obs and next_obs; `mask/train`, `mask/valid`.

    An observation group is a key of `obs`, a camera `front` the key `front_image`. Its depth is `front_depth`,
    (T, H, W, 1) float32 of `depth_scale` metres each; robomimic's own modality `depth` clips what is over 1.
    `front_segmentation` is (T, H, W, 1) uint16; `channels`, a JSON text, has its legend. `states` are the recorded
    arrays one after another, before each action; the attribute `state_layout` names them. `instructions` and
    `sub_tasks` are the words of each step, in UTF-8.
    """

    needs: ClassVar[Mapping[str, str]] = {"h5py": "anysim-export[robomimic]"}

    def __init__(
        self,
        *,
        images: Annotated[bool, Field(description="whether the images of cameras are in it")] = True,
        channels: Annotated[bool, Field(description="whether recorded depth and segmentation are in it")] = True,
        depth_scale: Annotated[
            float, Field(gt=0, description="metres of depth that are 1; 1 keeps every bit, a power of two too")
        ] = 1.0,
        compression: Annotated[int, Field(ge=0, le=9, description="of images, by gzip; 0: none")] = 1,
        valid: Annotated[float, Field(ge=0, lt=1, description="share of the demonstrations in mask/valid")] = 0.0,
    ) -> None:
        self._images, self._channels, self._depth_scale = images, channels, depth_scale
        self._compression, self._valid = compression, valid

    def places(self, data: DataSet) -> Mapping[str, str]:
        """What is in `obs` is in `next_obs` too, a row later."""
        layout = data.first.layout
        found = {"action": "`actions`", "collect/reward": "`rewards`", "collect/status": "`dones`, attribute `status`"}
        found |= {"annotation": "`sub_tasks`: skill, phase", "language": "`instructions`"}
        found |= {f"state/{name}": "`states`" for name in layout.state}
        found |= {f"observation/{name}": f"`obs/{name}`" for name in layout.obs}
        found |= {f"camera/{name}": f"`obs/{name}_image`" for name in self._cameras(data)}
        return found | {one.stream: f"`obs/{one.key}`" for one in self._pictures(data)}

    def check(self, data: DataSet) -> None:
        """Refuse two observations of one name."""
        cameras, pictures = self._cameras(data), self._pictures(data)
        refuse_shared([*data.first.layout.obs, *(f"{name}_image" for name in cameras), *(one.key for one in pictures)])

    def _cameras(self, data: DataSet) -> tuple[str, ...]:
        return tuple(data.first.cameras) if self._images else ()

    def _pictures(self, data: DataSet) -> tuple[Channel, ...]:
        return data.channels if self._channels else ()

    def _about(self, channel: Channel) -> dict[str, Any]:
        """What the numbers of depth and segmentation are; times `scale` they are of `unit`."""
        return channel.about | ({"scale": self._depth_scale} if channel.name == "depth" else {})

    def write_episode(self, folder: Path, episode: Episode, data: DataSet) -> None:
        """A file with the one demonstration."""
        with new_file(folder / DEMO_FILE) as (file, _):
            demo = file.create_group("demo")
            demo.attrs["num_samples"] = episode.steps
            demo.attrs["episode_seed"] = str(episode.manifest.episode_seed)  # of 64 bits and more
            demo.attrs["instruction"] = episode.tasks[0]
            demo.attrs["status"] = episode.manifest.status
            dones = np.zeros(episode.steps, np.int64)
            dones[-1] = 1
            rows: dict[str, Array] = {"actions": episode.actions, "rewards": episode.rewards, "dones": dones}
            rows["states"] = _flat(episode.states, episode.steps)
            rows["instructions"], rows["sub_tasks"] = _words(episode.tasks), _words(episode.segments)
            for name, values in rows.items():
                demo.create_dataset(name, data=values)
            for name, values in episode.obs.items():
                demo.create_dataset(f"obs/{name}", data=values[:-1])
                demo.create_dataset(f"next_obs/{name}", data=values[1:])
            for camera in self._cameras(data):
                entry = episode.manifest.cameras[camera]
                shape = (episode.steps, entry.height, entry.width, 3)
                self._write_images(demo, f"{camera}_image", shape, np.uint8, episode.images(camera))
            for one in self._pictures(data):
                shape, dtype = (episode.steps, *one.size, 1), np.dtype(one.entry.dtype)
                self._write_images(demo, one.key, shape, dtype, self._scaled(one, episode.channel(one)))

    def _scaled(self, channel: Channel, images: Iterator[Array]) -> Iterator[Array]:
        """(H, W, 1) each."""
        scale = np.float32(self._depth_scale)
        for image in images:
            yield (image / scale if channel.name == "depth" else image)[..., None]

    def _write_images(self, demo: Any, key: str, shape: tuple[int, ...], dtype: Any, images: Iterable[Array]) -> None:
        """Both rows of images, one image in memory at a time."""
        squeezed = {"compression": "gzip", "compression_opts": self._compression} if self._compression else {}
        before, after = (
            demo.create_dataset(f"{group}/{key}", shape, dtype, chunks=(1, *shape[1:]), **squeezed)
            for group in ("obs", "next_obs")
        )
        for t, image in enumerate(images):
            if t < shape[0]:
                before[t] = image
            if t:
                after[t - 1] = image

    def assemble(self, folder: Path, parts: Sequence[Path], data: DataSet) -> None:
        """All demonstrations in one file."""
        import h5py  # pyright: ignore[reportMissingImports]

        first, names = data.first, [f"demo_{i}" for i in range(len(parts))]
        with new_file(folder / DEMO_FILE) as (file, check):
            group = file.create_group("data")
            group.attrs["total"] = sum(one.steps for one in data.manifests)
            env = f"anysim_learning.envs:anysim/{first.task}-v0"
            about = {"env_name": env, "type": GYM_TYPE, "env_kwargs": {"engine": first.engine}}
            group.attrs["env_args"] = json.dumps(about, ensure_ascii=False)
            group.attrs["action_names"] = json.dumps(first.layout.action)
            layout = {name: list(first.layout.state[name]) for name in sorted(first.layout.state)}
            group.attrs["state_layout"] = json.dumps(layout)
            if pictures := self._pictures(data):
                said = {one.key: self._about(one) for one in pictures}
                file.create_dataset("channels", data=json.dumps(said))  # a legend may be more than an attribute holds
            for name, part in zip(names, parts, strict=True):
                with h5py.File(part / DEMO_FILE, "r") as one:
                    one.copy("demo", group, name)
                check()
            split = len(names) - round(self._valid * len(names))
            for mask, chosen in (("train", names[:split]), ("valid", names[split:])):
                if chosen:
                    file.create_dataset(f"mask/{mask}", data=np.array(chosen, dtype="S"))


def _words(words: Sequence[str]) -> Array:
    """(T,) bytes of the longest one's width, at least 1: HDF5 has no strings of none."""
    coded = [one.encode() for one in words]
    return np.array(coded, dtype=f"S{max(1, *map(len, coded))}")


def _flat(states: Mapping[str, Array], steps: int) -> Array:
    """(T, S): the states before each action, by name."""
    rows = [states[name][:steps].reshape(steps, -1) for name in sorted(states)]
    return np.concatenate([np.zeros((steps, 0)), *rows], axis=1)

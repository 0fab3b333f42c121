"""robomimic's HDF5: one file with a group of arrays for each demonstration (robomimic 0.3)."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim_export.api import DataSet, Episode, Exporter
from anysim_export.hdf5_files import new_file

DEMO_FILE = "demo.hdf5"
GYM_TYPE = 2
"""robomimic's number of an env that is made through gymnasium."""


class RobomimicExporter(Exporter):
    """`demo.hdf5`: `data/demo_0`, … with actions, dones, rewards, states, obs and next_obs; `mask/train`, `mask/valid`.

    An observation group is a key of `obs`, a camera `front` the key `front_image`. `states` are the recorded arrays one
    after another, before each action; the attribute `state_layout` names them. `instructions` and `sub_tasks` are the
    words of each step, in UTF-8.
    """

    needs: ClassVar[Mapping[str, str]] = {"h5py": "anysim-export[robomimic]"}

    def __init__(
        self,
        *,
        images: Annotated[bool, Field(description="whether the images of cameras are in it")] = True,
        compression: Annotated[int, Field(ge=0, le=9, description="of images, by gzip; 0: none")] = 1,
        valid: Annotated[float, Field(ge=0, lt=1, description="share of the demonstrations in mask/valid")] = 0.0,
    ) -> None:
        self._images, self._compression, self._valid = images, compression, valid

    def write_episode(self, folder: Path, episode: Episode, data: DataSet) -> None:
        """A file with the one demonstration."""
        with new_file(folder / DEMO_FILE) as (file, _):
            demo = file.create_group("demo")
            demo.attrs["num_samples"] = episode.steps
            demo.attrs["episode_seed"] = str(episode.manifest.episode_seed)  # of 64 bits and more
            demo.attrs["instruction"] = episode.tasks[0]
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
            for camera in episode.manifest.cameras if self._images else ():
                self._write_images(demo, camera, episode)

    def _write_images(self, demo: Any, camera: str, episode: Episode) -> None:
        """Both rows of images, one image in memory at a time."""
        entry = episode.manifest.cameras[camera]
        shape = (episode.steps, entry.height, entry.width, 3)
        squeezed = {"compression": "gzip", "compression_opts": self._compression} if self._compression else {}
        before, after = (
            demo.create_dataset(f"{group}/{camera}_image", shape, np.uint8, chunks=(1, *shape[1:]), **squeezed)
            for group in ("obs", "next_obs")
        )
        for t, image in enumerate(episode.images(camera)):
            if t < episode.steps:
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

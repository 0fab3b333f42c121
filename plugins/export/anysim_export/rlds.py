"""Episodes as builders of RLDS read them: arrays, words and images of each in files that need no TensorFlow."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.record.json import dump_json
from anysim.task.contract import Status
from anysim_export.api import DataSet, Episode, Exporter, refuse_shared, take_over, write_image
from anysim_export.streams import Channel

FEATURES_FILE, STEPS_FILE, WORDS_FILE = "features.json", "steps.npz", "words.json"
FORMAT = "anysim-rlds-ready-1"
WORDS = ("language_instruction", "sub_task")


class RldsReadyExporter(Exporter):
    """`features.json`, and for each episode `episodes/000000` with `steps.npz`, `words.json`, `CAMERA/000000.png`.

    Depth and segmentation are images of one channel: `CAMERA_depth`, whose float32 [m] are the four bytes of a pixel,
    as TFDS reads them, and `CAMERA_segmentation`, uint16, whose legend is in `features.json`.

    A step has what was observed before an action, the action, the reward that it got, `discount`, `is_first`, `is_last`
    and `is_terminal`, as RLDS names them: the last step is one with an action. An episode that ran out of time has no
    terminal step.
    """

    def __init__(
        self,
        *,
        images: Annotated[bool, Field(description="whether the images of cameras are in it")] = True,
        channels: Annotated[bool, Field(description="whether recorded depth and segmentation are in it")] = True,
        states: Annotated[bool, Field(description="whether the recorded states are in it")] = False,
        privileged: Annotated[bool, Field(description="whether what only a simulator knows is in it")] = False,
        valid: Annotated[float, Field(ge=0, lt=1, description="share of the episodes in the split `val`")] = 0.0,
    ) -> None:
        self._images, self._channels, self._states = images, channels, states
        self._privileged, self._valid = privileged, valid

    def places(self, data: DataSet) -> Mapping[str, str]:
        """Keys of a step, and of `episode_metadata`."""
        found = {"action": "`action`", "collect/reward": "`reward`", "collect/status": "`is_terminal`, `status`"}
        found |= {"annotation": "`sub_task`: skill, phase", "language": "`language_instruction`"}
        found |= {f"state/{name}": f"`observation/state_{name}`" for name in self._arrays(data)}
        found |= {f"observation/{name}": f"`observation/{name}`" for name in self._groups(data)}
        found |= {f"camera/{name}": f"`observation/{name}`" for name in self._cameras(data)}
        return found | {one.stream: f"`observation/{one.key}`" for one in self._pictures(data)}

    def check(self, data: DataSet) -> None:
        """Refuse two keys of `observation` that are equal."""
        states = [f"state_{name}" for name in self._arrays(data)]
        pictures = [one.key for one in self._pictures(data)]
        refuse_shared([*self._groups(data), *states, *self._cameras(data), *pictures])

    def write_episode(self, folder: Path, episode: Episode, data: DataSet) -> None:
        """The steps of an episode."""
        np.savez(folder / STEPS_FILE, allow_pickle=False, **self._rows(episode, data))
        about = {
            "episode_seed": str(episode.manifest.episode_seed),  # of 64 bits and more
            "status": episode.manifest.status,
            "task": episode.manifest.task,
            "robot": data.robot,
        }
        words = {"steps": episode.steps, **dict(zip(WORDS, (episode.tasks, episode.segments), strict=True))}
        (folder / WORDS_FILE).write_bytes(dump_json(words | {"episode_metadata": about}, "words"))
        for camera in self._cameras(data):
            (folder / camera).mkdir()
            for t, image in zip(range(episode.steps), episode.images(camera), strict=False):
                write_image(folder / camera / f"{t:06d}.png", image)
        for one in self._pictures(data):
            (folder / one.key).mkdir()
            for t, image in zip(range(episode.steps), episode.channel(one), strict=False):
                write_image(folder / one.key / f"{t:06d}.png", as_bytes(image) if one.name == "depth" else image)

    def _rows(self, episode: Episode, data: DataSet) -> dict[str, Array]:
        """Arrays (T, …) by the name of their feature."""
        steps = np.arange(episode.steps)
        last = steps == episode.steps - 1
        return {
            **{f"observation/{name}": episode.obs[name][:-1].astype(np.float32) for name in self._groups(data)},
            **{f"observation/state_{name}": episode.states[name][:-1] for name in self._arrays(data)},
            "action": episode.actions.astype(np.float32),
            "reward": episode.rewards.astype(np.float32),
            "discount": np.ones(episode.steps, np.float32),
            "is_first": steps == 0,
            "is_last": last,
            "is_terminal": last & (episode.manifest.status != Status.TRUNCATED),
        }

    def assemble(self, folder: Path, parts: Sequence[Path], data: DataSet) -> None:
        """All episodes side by side, and what is in a step."""
        for i, part in enumerate(parts):
            take_over(part, folder / "episodes" / f"{i:06d}")
        with np.load(parts[0] / STEPS_FILE, allow_pickle=False) as arrays:
            rows = {name: {"dtype": str(a.dtype), "shape": list(a.shape[1:])} for name, a in arrays.items()}
        cameras: dict[str, dict[str, Any]] = {
            f"observation/{name}": {"camera": name, "shape": [camera.height, camera.width, 3], "dtype": "uint8"}
            for name, camera in data.first.cameras.items()
            if name in self._cameras(data)
        }
        for one in self._pictures(data):
            said = {"camera": one.key, "shape": [*one.size, 1], **one.about}
            cameras[f"observation/{one.key}"] = said
        split = len(parts) - round(self._valid * len(parts))
        about = {
            "format": FORMAT,
            "task": data.first.task,
            "robot": data.robot,
            "control_dt": data.first.control_dt,
            "action_names": data.first.layout.action,
            "steps": rows,
            "images": cameras,
            "words": WORDS,
            "splits": {"train": [0, split]} | ({"val": [split, len(parts)]} if split < len(parts) else {}),
        }
        (folder / FEATURES_FILE).write_bytes(dump_json(about, "features"))

    def _groups(self, data: DataSet) -> list[str]:
        return [name for name in data.first.layout.obs if self._privileged or name != "privileged"]

    def _cameras(self, data: DataSet) -> list[str]:
        return list(data.first.cameras) if self._images else []

    def _arrays(self, data: DataSet) -> list[str]:
        return list(data.first.layout.state) if self._states else []

    def _pictures(self, data: DataSet) -> tuple[Channel, ...]:
        return data.channels if self._channels else ()


def as_bytes(image: Array) -> Array:
    """The four bytes of each of (H, W) float32, little end first, as (H, W, 4) uint8."""
    return np.ascontiguousarray(image, "<f4").view(np.uint8).reshape(*image.shape, 4)

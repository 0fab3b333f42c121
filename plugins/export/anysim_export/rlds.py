"""Episodes as builders of RLDS read them: arrays, words and images of each in files that need no TensorFlow."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.json import dump_json
from anysim.task.contract import Status
from anysim_export.api import DataSet, Episode, Exporter, take_over, write_image

FEATURES_FILE, STEPS_FILE, WORDS_FILE = "features.json", "steps.npz", "words.json"
FORMAT = "anysim-rlds-ready-1"
WORDS = ("language_instruction", "sub_task")


class RldsReadyExporter(Exporter):
    """`features.json`, and for each episode `episodes/000000` with `steps.npz`, `words.json`, `CAMERA/000000.png`.

    A step has what was observed before an action, the action, the reward that it got, `discount`, `is_first`, `is_last`
    and `is_terminal`, as RLDS names them: the last step is one with an action. An episode that ran out of time has no
    terminal step.
    """

    def __init__(
        self,
        *,
        images: Annotated[bool, Field(description="whether the images of cameras are in it")] = True,
        privileged: Annotated[bool, Field(description="whether what only a simulator knows is in it")] = False,
        valid: Annotated[float, Field(ge=0, lt=1, description="share of the episodes in the split `val`")] = 0.0,
    ) -> None:
        self._images, self._privileged, self._valid = images, privileged, valid

    def check(self, data: DataSet) -> None:
        """Refuse a camera that has the name of an observation group: both are keys of `observation`."""
        taken = sorted({*self._groups(data)} & {*self._cameras(data)})
        if taken:
            raise RecordError(
                f"'{taken[0]}' is an observation group and a camera, and both would be observation/{taken[0]}; rename "
                "the camera, or export with --option images=false"
            )

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

    def _rows(self, episode: Episode, data: DataSet) -> dict[str, Array]:
        """Arrays (T, …) by the name of their feature."""
        steps = np.arange(episode.steps)
        last = steps == episode.steps - 1
        return {
            **{f"observation/{name}": episode.obs[name][:-1].astype(np.float32) for name in self._groups(data)},
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
        cameras = {
            f"observation/{name}": {"camera": name, "shape": [camera.height, camera.width, 3], "dtype": "uint8"}
            for name, camera in data.first.cameras.items()
            if name in self._cameras(data)
        }
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

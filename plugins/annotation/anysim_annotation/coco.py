"""The exporter `coco`: images of recorded episodes, drawn anew, with boxes and masks of what is seen in them."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from anysim.record.film import capture_of
from anysim.record.json import dump_json, plain
from anysim.task.env import TaskEnv
from anysim_annotation.capture import Capture, Moment
from anysim_annotation.files import tidied
from anysim_annotation.stills.labels import ANNOTATORS, coco, objects
from anysim_annotation.view import Source
from anysim_export.api import DataSet, Episode, Exporter, take_over, write_image
from anysim_film.stage import FilmOrder, Stage, Staged, refuse_unknown_cameras
from anysim_schemas.load import LoadedRun

COCO_FILE, LABELS, IMAGES = "coco.json", "labels.json", "images"
ABOUT = ("episode", "step", "camera_name", "episode_seed", "instruction", "sub_task")


class CocoExporter(Exporter):
    """`images`, and `coco.json` as COCO's file of instances: boxes, masks as run lengths, a category a semantic label.

    Images are drawn anew from the recorded poses, so that a mask is that of its pixels, and a run needs no videos. Each
    has its episode, control step and camera, the instruction and the skill.
    """

    def __init__(
        self,
        *,
        cameras: Annotated[
            tuple[str, ...], Field(description="of the world; those recorded, or else all, if none is named")
        ] = (),
        every: Annotated[int, Field(ge=1, description="control steps from one image to the next")] = 25,
        engine: Annotated[str | None, Field(description="that draws; None: the recording's")] = None,
        labels: Annotated[
            Source, Field(description="where masks and boxes come from: the engine's drawing, or rays")
        ] = "engine",
        least_pixels: Annotated[int, Field(ge=1, description="a thing that shows fewer is left out")] = 16,
        ignore: Annotated[tuple[str, ...], Field(description="things, or labels, that are no object of interest")] = (),
    ) -> None:
        self._source: Source = labels
        self._every, self._least, self._ignore = every, least_pixels, ignore
        self._stage = Stage(FilmOrder(tuple(cameras), engine))
        self._capture: tuple[TaskEnv, Capture] | None = None

    def places(self, data: DataSet) -> Mapping[str, str]:
        """Images and masks are drawn anew, from the poses."""
        words = {"annotation": "images' `sub_task`: skill, phase", "language": "images' `instruction`"}
        return {"state/body_pose": "what is drawn", **words}

    def check(self, data: DataSet) -> None:
        """Refuse a camera that the world does not have."""
        self._cameras(self._stage.load(data.first))

    def write_episode(self, folder: Path, episode: Episode, data: DataSet) -> None:
        """Its images, and their labels."""
        loaded = self._stage.load(episode.manifest)
        cameras = self._cameras(loaded)
        staged = self._stage.begin(episode.directory, loaded)
        labels, colours = self._labels(staged.env, cameras), capture_of(staged.env)
        labels.begin()
        (folder / IMAGES).mkdir()
        said: list[dict[str, Any]] = []
        for step, poses in zip(staged.moments.steps.tolist(), staged.moments.body_pose, strict=True):
            if step % self._every:
                continue
            taken = labels.take(Moment(np.array([0]), np.array([step]), poses[None]))
            for camera in cameras:
                name = f"{episode.index:06d}_{step:06d}_{camera}.png"
                write_image(folder / IMAGES / name, colours.image_then(camera, 0, step, poses))
                one = self._about(episode, staged, step) | {"file": name, "camera_name": camera}
                one["camera"] = taken[camera]["camera"].records[0][0]
                said.append(one | {"objects": objects(taken[camera], 0, self._least, self._ignore)})
        (folder / LABELS).write_bytes(dump_json(tidied(plain(said)), "labels"))

    def _about(self, episode: Episode, staged: Staged, step: int) -> dict[str, Any]:
        """What an image says of its moment: the words are those of the action before it, of the first one at first."""
        before, manifest = max(step - 1, 0), staged.reader.manifest
        return {
            "episode": episode.index,
            "step": step,
            "episode_seed": str(manifest.episode_seed),  # of 64 bits and more
            "instruction": episode.tasks[before],
            "sub_task": episode.segments[before],
        }

    def assemble(self, folder: Path, parts: Sequence[Path], data: DataSet) -> None:
        """All images in one folder, and one file of labels."""
        said: list[dict[str, Any]] = []
        for part in parts:
            take_over(part / IMAGES, folder / IMAGES)
            said += json.loads((part / LABELS).read_text("utf-8"))
        (folder / COCO_FILE).write_bytes(dump_json(coco(said, ABOUT), "coco"))

    def close(self) -> None:
        """Free the engine."""
        self._capture = None
        self._stage.close()

    def _cameras(self, loaded: LoadedRun) -> tuple[str, ...]:
        there = loaded.spec.world.cameras
        chosen = self._stage.order.cameras or loaded.spec.record.cameras or tuple(there)
        refuse_unknown_cameras(chosen, there)
        return chosen

    def _labels(self, env: TaskEnv, cameras: Sequence[str]) -> Capture:
        """The annotators; the last ones again where the env is the same."""
        if self._capture is None or self._capture[0] is not env:
            self._capture = env, Capture(env, {camera: list(ANNOTATORS) for camera in cameras}, self._source)
        return self._capture[1]

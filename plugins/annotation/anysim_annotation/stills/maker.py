"""Scenes of a job of stills, each of them one reset of an env, as images with labels."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anysim.randomization.streams import episode_seed
from anysim.record.commit import write_whole
from anysim.record.json import dump_json, plain
from anysim.task.env import TaskEnv
from anysim_annotation.capture import Capture
from anysim_annotation.files import tidied, write_png
from anysim_annotation.stills.labels import ANNOTATORS, objects
from anysim_annotation.stills.spec import StillsSpec
from anysim_schemas.load import LoadedRun

IMAGES, LABELS = "images", "labels"


def loaded_job(job: StillsSpec, folder: Path) -> LoadedRun:
    """What a job draws; its source is looked for in the job's folder first."""
    from anysim.api import load, watched

    named = folder / job.source
    return watched(load(named if named.is_file() else job.source, overrides=["record.cameras=[]", *job.overrides]))


def stem(number: int) -> str:
    """Of the files of an image."""
    return f"{number:07d}"


def is_there(where: Path, number: int) -> bool:
    """Whether an image is complete: its labels are written last."""
    return (where / LABELS / f"{stem(number)}.json").exists()


def numbers_lacking(job: StillsSpec, cameras: Sequence[str], scene: int, where: Path) -> list[int]:
    """The images of a scene, one of each camera, that are not there yet."""
    first = scene * len(cameras)
    return [n for n in range(first, min(first + len(cameras), job.images)) if not is_there(where, n)]


class StillsMaker:
    """A process that makes scenes, in an env that it builds for the first of them and keeps."""

    def __init__(self, job: StillsSpec, folder: Path, cameras: Sequence[str], rows: int, where: Path) -> None:
        """`rows` are the scenes of a call, at most; images go into `where`."""
        self._job, self._folder, self._cameras, self._rows, self._where = job, folder, cameras, rows, where
        self._env: TaskEnv | None = None
        self._capture: Capture | None = None

    def __enter__(self) -> Callable[[Sequence[int]], int]:
        return self.make

    def __exit__(self, *_: object) -> None:
        if self._env is not None:
            self._env.close()

    def make(self, scenes: Sequence[int]) -> int:
        """Reset an env for each scene, and write the images that lack; how many."""
        env, capture = self._begun()
        padded = [*scenes, *[scenes[-1]] * (env.num_envs - len(scenes))]
        seeds = [episode_seed(self._job.seed, scene, 0) for scene in padded]
        env.reset(episode_seeds=seeds)
        capture.begin()
        labels, made = capture.take(), 0
        assert env.capture is not None
        for place, camera in enumerate(self._cameras):
            colours = env.capture.image(camera, np.arange(env.num_envs))
            for row, scene in enumerate(scenes):
                number = scene * len(self._cameras) + place
                if number not in numbers_lacking(self._job, self._cameras, scene, self._where):
                    continue
                said: dict[str, Any] = {
                    "image": number,
                    "file": f"{stem(number)}.png",
                    "scene": scene,
                    "seed": seeds[row],
                }
                said |= {"camera_name": camera, "camera": labels[camera]["camera"].records[row][0]}
                job = self._job
                said["objects"] = objects(labels[camera], row, job.least_pixels, job.ignore, job.masks)
                self._write(number, colours[row], said)
                made += 1
        return made

    def _begun(self) -> tuple[TaskEnv, Capture]:
        from anysim.api import make

        if self._env is None:
            loaded = loaded_job(self._job, self._folder)
            self._env = make(loaded, engine=self._job.engine, num_envs=self._rows)
        if self._capture is None:
            self._capture = Capture(self._env, {name: list(ANNOTATORS) for name in self._cameras}, self._job.labels)
        return self._env, self._capture

    def _write(self, number: int, image: np.ndarray, said: dict[str, Any]) -> None:
        """Write an image, and its labels last: they say that it is whole."""
        aside = self._where / IMAGES / f".{stem(number)}.{os.getpid()}"
        write_png(aside, image)
        aside.replace(self._where / IMAGES / f"{stem(number)}.png")
        write_whole(self._where / LABELS, {f"{stem(number)}.json": dump_json(tidied(plain(said)), "labels")})

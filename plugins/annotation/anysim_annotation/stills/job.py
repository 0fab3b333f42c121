"""Jobs of still images: a world is drawn anew for each, labelled, and kept; what is there already is passed over."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from anysim.errors import RecordError
from anysim.randomization.streams import episode_seed
from anysim.record.commit import write_whole
from anysim.record.incoming import FileLock
from anysim.record.json import dump_json, load_json, plain
from anysim.task.env import TaskEnv
from anysim_annotation.capture import Capture
from anysim_annotation.files import tidied, write_png
from anysim_annotation.stills.labels import ANNOTATORS, coco, kitti_camera, kitti_line, objects
from anysim_annotation.stills.spec import StillsSpec
from anysim_film.stage import refuse_unknown_cameras
from anysim_schemas.load import LoadedRun

JOB_FILE, COCO_FILE = "job.json", "coco.json"
IMAGES, LABELS = "images", "labels"


class Progress(NamedTuple):
    """Images that are there, of how many; `new` were made by this call."""

    done: int
    of: int
    new: int


def render_job(
    path: Path, out: Path | None = None, engine: str | None = None, overrides: Sequence[str] = ()
) -> Iterator[Progress]:
    """Make the images of a job that are not there yet, and then its files of labels.

    Args:
        path: of the job.
        out: the directory; `stills/NAME` if not given.
        engine: in place of the job's.
        overrides: of the job's source, after its own.

    Raises:
        SpecError: the job or its world is wrong, with the place.
        RecordError: the directory holds another job's images, another process makes them, or the disk is full.
    """
    from anysim_schemas.load import load

    job = load(StillsSpec, path).spec
    job = job.model_copy(update={"engine": engine or job.engine, "overrides": (*job.overrides, *overrides)})
    where = Path("stills") / path.stem if out is None else out
    try:
        for folder in (where / IMAGES, where / LABELS):
            folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock.take(where / ".lock")
        if lock is None:
            raise RecordError(f"another process makes the images in {where}; wait for it, or choose another --out")
        with lock:
            yield from _work(job, path.parent, where)
    except OSError as error:
        raise RecordError(
            f"cannot write into {where}: {error.strerror or error} ({error.filename or where}). Images that were "
            "complete are there; make room, and start it again"
        ) from error


def _work(job: StillsSpec, folder: Path, where: Path) -> Iterator[Progress]:
    loaded = _loaded(job, folder)
    cameras = _cameras(job, loaded)
    scenes = -(-job.images // len(cameras))
    asked = job.model_dump(mode="json", exclude={"batch"})
    sheet = {"format": "anysim-stills-1", "job": asked, "spec": plain(loaded.spec.to_dict()), "cameras": cameras}
    if (where / JOB_FILE).exists():
        if load_json(where / JOB_FILE) != plain(sheet):
            raise RecordError(f"{where} holds the images of another job, as {JOB_FILE} says; choose another --out")
    else:
        write_whole(where, {JOB_FILE: dump_json(sheet, "job")})
    lacking = [s for s in range(scenes) if not all(_there(where, n) for n in _numbers(job, cameras, s))]
    there, new = _count(job, where), 0
    yield Progress(there, job.images, new)
    if lacking:
        with _made(job, loaded, len(lacking)) as env:
            capture = Capture(env, {camera: list(ANNOTATORS) for camera in cameras}, job.labels)
            for begin in range(0, len(lacking), env.num_envs):
                part = lacking[begin : begin + env.num_envs]
                for _ in _draw(env, capture, job, cameras, part, where):
                    new += 1
                    yield Progress(there + new, job.images, new)
    _summarise(job, where)


def _loaded(job: StillsSpec, folder: Path) -> LoadedRun:
    from anysim.api import load, watched

    named = folder / job.source
    return watched(load(named if named.is_file() else job.source, overrides=["record.cameras=[]", *job.overrides]))


def _cameras(job: StillsSpec, loaded: LoadedRun) -> list[str]:
    there = loaded.spec.world.cameras
    chosen = job.cameras or tuple(name for name, camera in there.items() if "rgb" in camera.channels)
    refuse_unknown_cameras(chosen, there)
    if not chosen:
        raise RecordError(f"the world of '{job.source}' has no camera that gives colours; add one, or override it")
    return list(chosen)


def _made(job: StillsSpec, loaded: LoadedRun, scenes: int) -> TaskEnv:
    from anysim.api import make

    return make(loaded, engine=job.engine, num_envs=min(job.batch, scenes))


def _numbers(job: StillsSpec, cameras: Sequence[str], scene: int) -> list[int]:
    """The images of a scene."""
    first = scene * len(cameras)
    return list(range(first, min(first + len(cameras), job.images)))


def _stem(number: int) -> str:
    return f"{number:07d}"


def _there(where: Path, number: int) -> bool:
    return (where / LABELS / f"{_stem(number)}.json").exists()


def _count(job: StillsSpec, where: Path) -> int:
    return sum(_there(where, number) for number in range(job.images))


def _draw(
    env: TaskEnv, capture: Capture, job: StillsSpec, cameras: Sequence[str], scenes: Sequence[int], where: Path
) -> Iterator[int]:
    """Reset an env for each scene, and write its images: the labels last, which say that it is whole; their numbers."""
    padded = [*scenes, *[scenes[-1]] * (env.num_envs - len(scenes))]
    seeds = [episode_seed(job.seed, scene, 0) for scene in padded]
    env.reset(episode_seeds=seeds)
    capture.begin()
    labels = capture.take()
    assert env.capture is not None
    for place, camera in enumerate(cameras):
        colours = env.capture.image(camera, np.arange(env.num_envs))
        for row, scene in enumerate(scenes):
            number = scene * len(cameras) + place
            if number >= job.images or _there(where, number):
                continue
            write_png(where / IMAGES / f"{_stem(number)}.png", colours[row])
            said: dict[str, Any] = {"image": number, "file": f"{_stem(number)}.png", "scene": scene, "seed": seeds[row]}
            said |= {"camera_name": camera, "camera": labels[camera]["camera"].records[row][0]}
            said["objects"] = objects(labels[camera], row, job.least_pixels, job.ignore, job.masks)
            write_whole(where / LABELS, {f"{_stem(number)}.json": dump_json(tidied(plain(said)), "labels")})
            yield number


# ---------------------------------------------------------------------- files for trainers


def _summarise(job: StillsSpec, where: Path) -> None:
    """Write what other programs read, from the labels alone."""
    said = [load_json(where / LABELS / f"{_stem(number)}.json") for number in range(job.images)]
    if "coco" in job.formats:
        write_whole(where, {COCO_FILE: dump_json(coco(said, ("scene", "seed", "camera_name")), "coco")})
    if "kitti" in job.formats:
        for name in ("label_2", "calib"):
            (where / "kitti" / name).mkdir(parents=True, exist_ok=True)
        for one in said:
            stem = _stem(one["image"])
            lines = "".join(kitti_line(thing) for thing in one["objects"])
            write_whole(where / "kitti" / "label_2", {f"{stem}.txt": lines})
            write_whole(where / "kitti" / "calib", {f"{stem}.txt": kitti_camera(one["camera"])})

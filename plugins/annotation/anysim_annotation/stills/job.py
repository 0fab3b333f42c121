"""Jobs of still images: a world is drawn anew for each, labelled, and kept; what is there already is passed over."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from anysim.errors import RecordError
from anysim.record.commit import write_whole
from anysim.record.incoming import FileLock
from anysim.record.json import dump_json, load_json, plain
from anysim_annotation.stills.labels import coco, kitti_camera, kitti_line
from anysim_annotation.stills.maker import IMAGES, LABELS, StillsMaker, is_there, loaded_job, numbers_lacking, stem
from anysim_annotation.stills.spec import StillsSpec
from anysim_film.stage import refuse_unknown_cameras
from anysim_processes.executors import share
from anysim_schemas.load import LoadedRun

JOB_FILE, COCO_FILE = "job.json", "coco.json"


class Progress(NamedTuple):
    """Images that are there, of how many; `new` were made by this call."""

    done: int
    of: int
    new: int


def render_job(
    path: Path,
    out: Path | None = None,
    engine: str | None = None,
    overrides: Sequence[str] = (),
    jobs: int | None = None,
    executor: str | None = None,
) -> Iterator[Progress]:
    """Make the images of a job that are not there yet, and then its files of labels; yields at first, and for each.

    Args:
        path: of the job.
        out: the directory; `stills/NAME` if not given.
        engine: in place of the job's.
        overrides: of the job's source, after its own.
        jobs: processes that share the images, by default one; what they write does not depend on it. With more than
            one, a program guards its main module, which each imports.
        executor: whose workers do it in place of such processes; in place of the job's.

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
            yield from _work(job, path.parent, where, jobs, executor or job.executor)
    except OSError as error:
        raise RecordError(
            f"cannot write into {where}: {error.strerror or error} ({error.filename or where}). Images that were "
            "complete are there; make room, and start it again"
        ) from error


def _work(job: StillsSpec, folder: Path, where: Path, jobs: int | None, executor: str | None) -> Iterator[Progress]:
    loaded = loaded_job(job, folder)
    cameras = _cameras(job, loaded)
    scenes = -(-job.images // len(cameras))
    asked = job.model_dump(mode="json", exclude={"batch", "executor"})
    sheet = {"format": "anysim-stills-1", "job": asked, "spec": plain(loaded.spec.to_dict()), "cameras": cameras}
    if (where / JOB_FILE).exists():
        if load_json(where / JOB_FILE) != plain(sheet):
            raise RecordError(f"{where} holds the images of another job, as {JOB_FILE} says; choose another --out")
    else:
        write_whole(where, {JOB_FILE: dump_json(sheet, "job")})
    _tidy(where)
    lacking = [s for s in range(scenes) if numbers_lacking(job, cameras, s, where)]
    there, new = _count(job, where), 0
    yield Progress(there, job.images, new)
    rows = min(job.batch, -(-len(lacking) // (jobs or 1)))
    parts = [(tuple(lacking[begin : begin + rows]),) for begin in range(0, len(lacking), rows or 1)]
    for made in share(
        executor, parts, partial(StillsMaker, job, folder.absolute(), cameras, rows, where.absolute()), jobs
    ):
        for _ in range(made):
            new += 1
            yield Progress(there + new, job.images, new)
    _summarise(job, where)


def _tidy(where: Path) -> None:
    """Remove what a process that was killed had begun to write."""
    for folder in (where / IMAGES, where / LABELS):
        for half in folder.glob(".*"):
            half.unlink(missing_ok=True)


def _cameras(job: StillsSpec, loaded: LoadedRun) -> list[str]:
    there = loaded.spec.world.cameras
    chosen = job.cameras or tuple(name for name, camera in there.items() if "rgb" in camera.channels)
    refuse_unknown_cameras(chosen, there)
    if not chosen:
        raise RecordError(f"the world of '{job.source}' has no camera that gives colours; add one, or override it")
    return list(chosen)


def _count(job: StillsSpec, where: Path) -> int:
    return sum(is_there(where, number) for number in range(job.images))


# ---------------------------------------------------------------------- files for trainers


def _summarise(job: StillsSpec, where: Path) -> None:
    """Write what other programs read, from the labels alone."""
    said = [load_json(where / LABELS / f"{stem(number)}.json") for number in range(job.images)]
    if "coco" in job.formats:
        write_whole(where, {COCO_FILE: dump_json(coco(said, ("scene", "seed", "camera_name")), "coco")})
    if "kitti" in job.formats:
        for part in ("label_2", "calib"):
            (where / "kitti" / part).mkdir(parents=True, exist_ok=True)
        for one in said:
            name = stem(one["image"])
            lines = "".join(kitti_line(thing) for thing in one["objects"])
            write_whole(where / "kitti" / "label_2", {f"{name}.txt": lines})
            write_whole(where / "kitti" / "calib", {f"{name}.txt": kitti_camera(one["camera"])})

"""Annotations of recorded trajectories, made afterwards from their states and committed whole beside them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, Self

from anysim.errors import RecordError
from anysim.record.commit import seal
from anysim.record.json import dump_json, plain
from anysim.record.manifest import Manifest, read_manifest
from anysim.task.env import TaskEnv
from anysim_annotation.capture import Capture
from anysim_annotation.orders import Orders, read_orders
from anysim_annotation.recorded import EpisodeFiles
from anysim_annotation.sheet import SHEET_FILE, SUFFIX, AnnotationSheet, CameraSheet, read_annotations
from anysim_annotation.view import Source
from anysim_film.commit import move_in, workspace
from anysim_film.stage import FilmOrder, Stage, facts_of, refuse_damage, refuse_unknown_cameras
from anysim_processes.executors import share
from anysim_schemas.load import LoadedRun


@dataclass(frozen=True)
class Annotated:
    """What came of one trajectory.

    Attributes:
        trajectory: its directory.
        directory: where its annotations are.
        made: `camera.annotator` of those made now; `present` those that were there already.
        frames: images labelled now.
        engine: in which they were made, with version; empty where nothing was.
        recorded_with: the engine of the recording, with version.
        still: bodies that the recording does not have, and that stand where the reset put them.
    """

    trajectory: Path
    directory: Path
    made: tuple[str, ...]
    present: tuple[str, ...]
    frames: int = 0
    engine: str = ""
    recorded_with: str = ""
    still: tuple[str, ...] = ()


class AnnotationMaker:
    """Annotates trajectories one after the other. The env of one is kept for the next one of the same run."""

    def __init__(self, order: FilmOrder, orders: Orders, source: Source) -> None:
        self._stage, self._order, self._orders = Stage(order), order, orders
        self._source: Source = source
        self._capture: tuple[TaskEnv, Mapping[str, Orders], Capture] | None = None

    def annotate(self, trajectory: Path, directory: Path | None = None) -> Annotated:
        """Make of a trajectory what is not there yet.

        Args:
            trajectory: a committed one.
            directory: of the annotations; None puts them beside it, into a directory of its name and `.annotations`.

        Raises:
            RecordError: the trajectory or what is in `directory` is damaged or is of something else, or there is no
                such camera.
            CapabilityError: the engine cannot draw this world.
        """
        manifest = read_manifest(trajectory)
        where = trajectory.with_name(trajectory.name + SUFFIX) if directory is None else directory
        loaded = self._stage.load(manifest)
        cameras = self._cameras(loaded)
        if self._missing(manifest, loaded, where, cameras):
            try:
                where.mkdir(parents=True, exist_ok=True)
                with workspace(where.resolve()) as aside:
                    return self._make(trajectory, where, aside, loaded, cameras)
            except OSError as error:
                raise RecordError(
                    f"cannot annotate {trajectory}: {error.strerror or error} ({error.filename or where}). What was "
                    "complete is there; make room, or choose another directory, and start it again"
                ) from error
        return Annotated(trajectory, where, (), _names({camera: self._orders for camera in cameras}))

    def close(self) -> None:
        """Free the engine."""
        self._capture = None
        self._stage.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ------------------------------------------------------------------ what

    def _cameras(self, loaded: LoadedRun) -> tuple[str, ...]:
        there = loaded.spec.world.cameras
        chosen = self._order.cameras or loaded.spec.record.cameras or tuple(there)
        refuse_unknown_cameras(chosen, there)
        if not chosen:
            raise RecordError("the recorded world has no camera; add one, as in -o world.cameras.eye={...}")
        return chosen

    def _missing(self, manifest: Manifest, loaded: LoadedRun, where: Path, cameras: Sequence[str]) -> dict[str, Orders]:
        """What is not there, by camera."""
        sheet = read_annotations(where)
        if sheet is None:
            return {camera: self._orders for camera in cameras}
        same = sheet.final_digest == manifest.final_digest and sheet.source == self._source
        if not same or sheet.spec != plain(loaded.spec.to_dict()):
            raise RecordError(
                f"{where} holds annotations of something else, as {SHEET_FILE} says; choose another --out, or remove it"
            )
        missing: dict[str, Orders] = {}
        for camera in cameras:
            there = sheet.cameras[camera].annotators if camera in sheet.cameras else {}
            for name, params in self._orders.items():
                if name in there and there[name].parameters != plain(params):
                    raise RecordError(
                        f"{where} holds '{name}' of camera '{camera}' with other parameters; choose another --out"
                    )
            if lacking := {name: params for name, params in self._orders.items() if name not in there}:
                missing[camera] = lacking
        return missing

    # ------------------------------------------------------------------ how

    def _make(self, trajectory: Path, where: Path, aside: Path, loaded: LoadedRun, cameras: Sequence[str]) -> Annotated:
        """Make what is missing, while no other process does."""
        manifest = read_manifest(trajectory)
        missing = self._missing(manifest, loaded, where, cameras)
        every_one = {camera: self._orders for camera in cameras}
        if not missing:
            return Annotated(trajectory, where, (), _names(every_one))
        refuse_damage(trajectory, manifest)
        staged = self._stage.begin(trajectory, loaded)
        capture = self._captured(staged.env, missing)
        files = EpisodeFiles(capture, missing, aside)
        assert staged.env.capture is not None
        steps = files.draw(staged.env, staged.reader, staged.moments, staged.env.capture.every)
        found, members = files.finish(steps)
        legend = capture.scene(next(iter(missing))).legend.to_dict()
        sheet = read_annotations(where) or AnnotationSheet(
            **facts_of(staged, loaded), source=self._source, steps=tuple(steps), legend=legend
        )
        _add(aside, where, sheet, found, members)
        present = tuple(name for name in _names(every_one) if name not in _names(missing))
        frames = len(steps) * len(missing)
        return Annotated(trajectory, where, _names(missing), present, frames, *staged.engines, staged.still)

    def _captured(self, env: TaskEnv, orders: Mapping[str, Orders]) -> Capture:
        """The annotators; the last ones again where the same are asked for."""
        if self._capture is None or self._capture[0] is not env or self._capture[1] != orders:
            self._capture = env, orders, Capture(env, orders, self._source)
        return self._capture[2]


def annotate(
    work: Sequence[tuple[Path, Path | None]],
    order: FilmOrder,
    text: str,
    source: Source,
    jobs: int | None = None,
    executor: str | None = None,
) -> Iterator[Annotated]:
    """Annotate trajectories, each into its directory, as `anysim render --annotate` does; yields each when done.

    With more than one process (`jobs`), or by the workers of an executor, they come in any order, with the same labels.
    """
    return share(executor, work, partial(_annotating, order, read_orders(text), source), jobs)


@contextmanager
def _annotating(order: FilmOrder, orders: Orders, source: Source) -> Iterator[Callable[[Path, Path | None], Annotated]]:
    with AnnotationMaker(order, orders, source) as maker:
        yield maker.annotate


def _names(orders: Mapping[str, Orders]) -> tuple[str, ...]:
    return tuple(f"{camera}.{name}" for camera, wanted in orders.items() for name in wanted)


def _add(
    aside: Path, where: Path, sheet: AnnotationSheet, cameras: Mapping[str, CameraSheet], members: Sequence[str]
) -> None:
    """Move finished files from `aside` into `where`, and then name them in the sheet, which is replaced in one step.

    A crash on the way leaves files that the sheet does not know, and that are replaced when they are made again.
    """
    entries = seal(aside, members)
    grown = dict(sheet.cameras)
    for camera, new in cameras.items():
        old = grown.get(camera, new)
        grown[camera] = CameraSheet(width=new.width, height=new.height, annotators={**old.annotators, **new.annotators})
    at = datetime.now(UTC).isoformat()
    said = {f"{camera}.{name}": at for camera, one in cameras.items() for name in one.annotators}
    more = {"cameras": grown, "files": {**sheet.files, **entries}, "clock": {**sheet.clock, **said}}
    whole: dict[str, Any] = {**dict(sheet), **more}
    move_in(aside, where, members, SHEET_FILE, dump_json(AnnotationSheet(**whole).to_dict(), "annotations"))

"""Annotations of recorded trajectories, made afterwards from their states and committed whole beside them."""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from anysim.errors import RecordError, listing, suggest
from anysim.record.commit import fsync, seal, write_durably
from anysim.record.json import dump_json, plain
from anysim.record.manifest import Manifest, read_manifest
from anysim.record.reader import open_trajectory
from anysim.record.replay import begin
from anysim.task.env import TaskEnv
from anysim_annotation.capture import Capture
from anysim_annotation.orders import Orders, read_orders
from anysim_annotation.recorded import EpisodeFiles
from anysim_annotation.sheet import SHEET_FILE, SUFFIX, AnnotationSheet, CameraSheet, read_annotations
from anysim_annotation.view import Source
from anysim_film.commit import workspace
from anysim_film.episode import moments_for
from anysim_film.stage import FilmOrder, Stage, recorded_moments, refuse_damage
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
        for name in chosen:
            if name not in there:
                raise RecordError(
                    f"there is no camera '{name}'{suggest(name, list(there))} (cameras: {listing(there)})"
                )
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
        env = self._stage.env(loaded)
        engine, reader = env.engine, open_trajectory(trajectory)
        still = tuple(body.name for body in engine.world.bodies if body.name not in manifest.layout.bodies)
        begin(env, manifest)
        moments = moments_for(env, manifest.layout.bodies, *recorded_moments(reader))
        files = EpisodeFiles(self._captured(env, missing), missing, aside)
        assert env.capture is not None
        steps = files.draw(env, reader, moments, env.capture.every)
        found, members = files.finish(steps)
        legend = self._captured(env, missing).scene(next(iter(missing))).legend.to_dict()
        sheet = read_annotations(where) or AnnotationSheet(
            task=manifest.task,
            env=manifest.env,
            episode=manifest.episode,
            episode_seed=manifest.episode_seed,
            final_digest=manifest.final_digest,
            source=self._source,
            engine=engine.name,
            engine_version=engine.version,
            world_hash=engine.world.hash,
            spec=plain(loaded.spec.to_dict()),
            still=still,
            steps=tuple(steps),
            legend=legend,
        )
        _add(aside, where, sheet, found, members)
        drawn, before = f"{engine.name} {engine.version}", f"{manifest.engine} {manifest.engine_version}"
        present = tuple(name for name in _names(every_one) if name not in _names(missing))
        return Annotated(trajectory, where, _names(missing), present, len(steps) * len(missing), drawn, before, still)

    def _captured(self, env: TaskEnv, orders: Mapping[str, Orders]) -> Capture:
        """The annotators; the last ones again where the same are asked for."""
        if self._capture is None or self._capture[0] is not env or self._capture[1] != orders:
            self._capture = env, orders, Capture(env, orders, self._source)
        return self._capture[2]


def annotate(
    work: Sequence[tuple[Path, Path | None]], order: FilmOrder, text: str, source: Source
) -> Iterator[Annotated]:
    """Annotate trajectories, each into its directory, as `anysim render --annotate` does; yields each when done."""
    with AnnotationMaker(order, read_orders(text), source) as maker:
        for trajectory, directory in work:
            yield maker.annotate(trajectory, directory)


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
    write_durably(aside / SHEET_FILE, dump_json(AnnotationSheet(**whole).to_dict(), "annotations"))
    for top in dict.fromkeys(name.partition("/")[0] for name in members):
        if (where / top).is_dir():
            shutil.rmtree(where / top)
        if (aside / top).is_dir():
            fsync(aside / top)
        (aside / top).replace(where / top)
    fsync(where)
    (aside / SHEET_FILE).replace(where / SHEET_FILE)
    fsync(where)

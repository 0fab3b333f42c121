"""Filming recorded trajectories: their videos, made afterwards, as they would have been or otherwise."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Self

from anysim.errors import RecordError
from anysim.record.json import plain
from anysim.record.manifest import Manifest, read_manifest
from anysim.record.names import MANIFEST_FILE
from anysim.record.writer import make_writer
from anysim_film.commit import add_videos, workspace
from anysim_film.episode import film_episode
from anysim_film.sheet import FILM_FILE, FilmSheet, read_sheet
from anysim_film.stage import FilmOrder, Stage, facts_of, refuse_damage, refuse_unknown_cameras
from anysim_processes.executors import share
from anysim_schemas.load import LoadedRun


@dataclass(frozen=True)
class Filmed:
    """What came of one trajectory.

    Attributes:
        trajectory: its directory.
        directory: where its videos are.
        cameras: those filmed now; `present` those whose videos were there already.
        frames: images drawn now.
        engine: what drew them, with version; empty where nothing was drawn.
        recorded_with: the engine of the recording, with version: the pixels of another version may be others.
        still: bodies that the recording does not have, and that stand where the reset put them.
    """

    trajectory: Path
    directory: Path
    cameras: tuple[str, ...]
    present: tuple[str, ...]
    frames: int = 0
    engine: str = ""
    recorded_with: str = ""
    still: tuple[str, ...] = ()


class Filmer:
    """Films trajectories one after the other. The env of one is kept for the next one of the same run."""

    def __init__(self, order: FilmOrder) -> None:
        self.order, self._stage = order, Stage(order)

    def film(self, trajectory: Path, directory: Path | None = None) -> Filmed:
        """Film a trajectory: what is not there yet of what was ordered.

        Args:
            trajectory: a committed one.
            directory: of the videos and their sheet; None adds them to the trajectory itself, for which they must be
                those that a live recording would have taken.

        Raises:
            RecordError: the trajectory or what is in `directory` is damaged or is of something else, or there is no
                such camera.
            CapabilityError: the engine cannot draw this world.
        """
        manifest = read_manifest(trajectory)
        if directory is None and not self.order.as_recorded(manifest):
            raise RecordError(
                f"{trajectory} holds what was recorded, and other cameras' sizes, looks or engines are not: pass --out "
                "DIR for videos beside it"
            )
        loaded = self._stage.load(manifest)
        cameras = self._cameras(loaded)
        where = trajectory if directory is None else directory
        present = self._present(manifest, loaded, directory)
        if present >= set(cameras):
            return Filmed(trajectory, where, (), cameras)
        try:
            where.mkdir(parents=True, exist_ok=True)
            with workspace(where.resolve()) as aside:
                return self._make(trajectory, directory, aside, loaded, cameras)
        except OSError as error:
            raise RecordError(
                f"cannot film {trajectory}: {error.strerror or error} ({error.filename or where}). Videos that were "
                "complete are there; make room, or choose another directory, and start it again"
            ) from error

    def close(self) -> None:
        """Free the engine."""
        self._stage.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ------------------------------------------------------------------ what and where

    def _cameras(self, loaded: LoadedRun) -> tuple[str, ...]:
        there = loaded.spec.world.cameras
        seeing = tuple(name for name, camera in there.items() if "rgb" in camera.channels)
        chosen = self.order.cameras or loaded.spec.record.cameras or seeing
        refuse_unknown_cameras(chosen, there)
        for name in chosen:
            if name not in seeing:
                raise RecordError(f"the camera '{name}' gives no colours; add -o world.cameras.{name}.channels=[rgb]")
        if not chosen:
            raise RecordError("the recorded world has no camera; add one, as in -o world.cameras.eye={...}, and --out")
        return chosen

    def _present(self, manifest: Manifest, loaded: LoadedRun, directory: Path | None) -> set[str]:
        """The cameras whose videos are there."""
        if directory is None:
            return set(manifest.cameras)
        sheet = read_sheet(directory)
        if sheet is None:
            return set()
        if sheet.final_digest != manifest.final_digest or sheet.spec != plain(loaded.spec.to_dict()):
            raise RecordError(f"{directory} holds videos of something else, as {FILM_FILE} says; choose another --out")
        return set(sheet.cameras)

    # ------------------------------------------------------------------ how

    def _make(
        self, trajectory: Path, directory: Path | None, aside: Path, loaded: LoadedRun, cameras: Sequence[str]
    ) -> Filmed:
        """Film what is missing, while no other process does."""
        manifest = read_manifest(trajectory)
        present = self._present(manifest, loaded, directory)
        missing = tuple(camera for camera in cameras if camera not in present)
        where = trajectory if directory is None else directory
        if not missing:
            return Filmed(trajectory, where, (), tuple(cameras))
        refuse_damage(trajectory, manifest)
        engine = self._stage.env(loaded).engine
        if directory is None and engine.world.hash != manifest.world_hash:
            raise RecordError(
                f"the world of {trajectory} cannot be rebuilt as it was (its hash differs), so these would not be its "
                "images; pass --out DIR for videos beside it"
            )
        staged, record = self._stage.begin(trajectory, loaded), loaded.spec.record
        sheet: FilmSheet | None = None
        if directory is not None:
            sheet = read_sheet(directory) or FilmSheet(**facts_of(staged, loaded))
        writer = make_writer(record.writer, record.options)
        found = film_episode(staged.env, manifest, staged.moments, missing, aside, writer)
        drawn, before = staged.engines
        said = {"at": datetime.now(UTC).isoformat(), "engine": drawn, "renderer": engine.renderer_name()}
        clock = dict.fromkeys(found, said)
        if directory is None or sheet is None:
            add_videos(aside, trajectory, MANIFEST_FILE, manifest, found, clock)
        else:
            add_videos(aside, directory, FILM_FILE, sheet, found, clock)
        frames = sum(entry.frames for entry in found.values())
        others = tuple(camera for camera in cameras if camera in present)
        return Filmed(trajectory, where, missing, others, frames, drawn, before, staged.still)


def film_targets(trajectories: Sequence[Path], out: Path | None) -> list[tuple[Path, Path | None]]:
    """Each trajectory and the directory of its videos in `out`, by its name, and its run's where names are not enough.

    Raises:
        RecordError: two trajectories would share a directory.
    """
    if out is None:
        return [(path, None) for path in trajectories]
    for name in (lambda path: path.name, lambda path: f"{path.resolve().parent.parent.name}/{path.name}"):
        places = [out / name(path) for path in trajectories]
        if len(set(places)) == len(places):
            return list(zip(trajectories, places, strict=True))
    raise RecordError("runs of the same name were given together; film them one by one, each into its own --out")


def film_all(
    work: Sequence[tuple[Path, Path | None]], order: FilmOrder, jobs: int | None = None, executor: str | None = None
) -> Iterator[Filmed]:
    """Film trajectories, each into its directory (`Filmer.film`); yields each when done.

    It is done in up to `jobs` processes, by default in this one, or by the workers of an executor.
    """
    return share(executor, work, partial(_filming, order), jobs)


@contextmanager
def _filming(order: FilmOrder) -> Iterator[Callable[[Path, Path | None], Filmed]]:
    with Filmer(order) as filmer:
        yield filmer.film

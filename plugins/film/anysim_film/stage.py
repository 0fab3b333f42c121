"""Stages: envs in which recorded episodes are set up to be looked at again, with what was ordered otherwise."""

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from anysim.errors import RecordError, listing, suggest
from anysim.record.commit import describe
from anysim.record.json import plain
from anysim.record.manifest import Manifest
from anysim.record.reader import TrajectoryReader, open_trajectory
from anysim.record.replay import begin
from anysim.task.env import TaskEnv
from anysim_film.episode import Moments, moments_for
from anysim_schemas.load import LoadedRun


@dataclass(frozen=True)
class FilmOrder:
    """What to film, of each trajectory.

    Attributes:
        cameras: of its world; none: those that its run records, or else all that give colours.
        engine: another one than it was recorded on.
        overrides: of the recorded spec, such as `world.objects.cube.color=red`.
        size: width and height of the images [px], in place of the cameras' own.
        fps: images per second, in place of the recorded spec's.
        base: folder of the recorded file, where its world has assets with relative paths.
    """

    cameras: tuple[str, ...] = ()
    engine: str | None = None
    overrides: tuple[str, ...] = ()
    size: tuple[int, int] | None = None
    fps: float | None = None
    base: Path | None = None

    def as_recorded(self, manifest: Manifest) -> bool:
        """Whether these are the images that a live recording would have taken."""
        changed = bool(self.overrides) or self.size is not None or self.fps is not None
        return not changed and self.engine in (None, manifest.engine)


class Staged(NamedTuple):
    """A recorded episode that env 0 of an env has begun.

    Attributes:
        env, reader: of it.
        moments: all that were recorded, for the env's bodies.
        still: bodies that the recording does not have, and that stand where the reset put them.
    """

    env: TaskEnv
    reader: TrajectoryReader
    moments: Moments
    still: tuple[str, ...]

    @property
    def engines(self) -> tuple[str, str]:
        """What draws, and what recorded, with versions."""
        engine, manifest = self.env.engine, self.reader.manifest
        return f"{engine.name} {engine.version}", f"{manifest.engine} {manifest.engine_version}"


class Stage:
    """Sets up trajectories one after the other. The env of one is kept for the next one of the same run."""

    def __init__(self, order: FilmOrder) -> None:
        self.order = order
        self._text = ""
        self._loaded: LoadedRun | None = None
        self._env: TaskEnv | None = None

    def load(self, manifest: Manifest) -> LoadedRun:
        """The spec to draw with; the last one again where the trajectories are of one run."""
        from anysim.api import load

        text = json.dumps(plain(manifest.spec))
        if self._loaded is None or text != self._text:
            self.close()
            spec = dict(manifest.spec) | {"num_envs": 1}
            first = load(spec, overrides=self._changes(load(spec)))
            self._loaded, self._text = first, text
        return self._loaded

    def _changes(self, recorded: LoadedRun) -> list[str]:
        """The overrides of the recorded spec."""
        order, changes = self.order, ["engine.shards=1"]
        if order.engine is not None and order.engine != recorded.spec.engine.name:
            changes.append(f"engine={json.dumps(order.engine)}")
        changes += order.overrides
        if order.fps is not None:
            changes.append(f"record.fps={order.fps}")
        if order.size is not None:
            cameras = order.cameras or recorded.spec.record.cameras or tuple(recorded.spec.world.cameras)
            changes += [f"world.cameras.{name}.size={list(order.size)}" for name in cameras]
        return changes

    def env(self, loaded: LoadedRun) -> TaskEnv:
        """The env to draw in."""
        from anysim.api import make

        if self._env is None:
            self._env = make(loaded, base=self.order.base)
        return self._env

    def begin(self, trajectory: Path, loaded: LoadedRun) -> Staged:
        """Begin the episode of a trajectory.

        Raises:
            RecordError: it does not hold poses.
        """
        env, reader = self.env(loaded), open_trajectory(trajectory)
        bodies = reader.manifest.layout.bodies
        still = tuple(body.name for body in env.engine.world.bodies if body.name not in bodies)
        begin(env, reader.manifest)
        return Staged(env, reader, moments_for(env, bodies, *recorded_moments(reader)), still)

    def close(self) -> None:
        """Free the engine."""
        if self._env is not None:
            self._env.close()
            self._env = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def refuse_unknown_cameras(chosen: Sequence[str], there: Collection[str]) -> None:
    """Raise RecordError for a camera that a world does not have."""
    for name in chosen:
        if name not in there:
            raise RecordError(f"there is no camera '{name}'{suggest(name, list(there))} (cameras: {listing(there)})")


def recorded_moments(reader: TrajectoryReader) -> Moments:
    """All recorded moments, in the order of the recording's bodies."""
    if "body_pose" not in reader.manifest.layout.state:
        raise RecordError(f"{reader.directory} does not hold body_pose, which its images are drawn from")
    steps = np.arange(reader.manifest.steps + 1)
    if not reader.initial_state:
        return Moments(steps[1:], np.asarray(reader.states["body_pose"]))
    return Moments(steps, reader.states_from_reset("body_pose"))


def refuse_damage(trajectory: Path, manifest: Manifest) -> None:
    """The videos that are there do not matter here."""
    videos = {camera.file for camera in manifest.cameras.values()}
    for name, entry in manifest.files.items():
        file = trajectory / name
        if name not in videos and (not file.is_file() or describe(file) != entry):
            raise RecordError(f"{file} is not what was committed, so nothing is drawn from it; record it again")


def facts_of(staged: Staged, loaded: LoadedRun) -> dict[str, Any]:
    """What a sheet says of an episode, and of what it is drawn with: see `DrawnSheet`."""
    manifest, engine = staged.reader.manifest, staged.env.engine
    recorded = {name: getattr(manifest, name) for name in ("task", "env", "episode", "episode_seed", "final_digest")}
    drawn = {"engine": engine.name, "engine_version": engine.version, "world_hash": engine.world.hash}
    return {**recorded, **drawn, "spec": plain(loaded.spec.to_dict()), "still": staged.still}

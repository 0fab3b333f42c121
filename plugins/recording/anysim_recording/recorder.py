"""The recorder of a run: keeps the open episodes of its envs in columns, and commits or discards each.

The thread that steps fills columns and nothing else. All that touches the disk happens in order on the recorder's own
thread: images as they come, everything else when an episode is committed. Images that are drawn from the columns of an
episode are drawn by the thread that steps, when it commits the episode.
"""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from datetime import UTC, datetime
from functools import cached_property, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from anysim import registry
from anysim.conventions import Array
from anysim.errors import RecordError, listing
from anysim.math.matrix import blas_kernel
from anysim.record.columns import ColumnStore, EpisodeColumns, check_columns
from anysim.record.commit import describe_run, disk_trouble
from anysim.record.frame import FrameBatch, RecordedFrame
from anysim.record.header import EpisodeHeader, Header, RunHeader
from anysim.record.incoming import Incoming
from anysim.record.json import plain
from anysim.record.names import EPISODES, parse_trajectory, trajectories, trajectory_name
from anysim.record.streams import StreamPart, StreamSource, blame, close_sources
from anysim.record.writer import StreamWriter, TrajectoryWriter
from anysim_recording.committer import Committer
from anysim_recording.episode import BatchChecks, Film, OpenEpisode, batch_of
from anysim_recording.trajectory_files import Ending, PendingCommit, TrajectoryFiles


def _write_part(part: StreamPart, blamed: registry.Blame, writer: StreamWriter) -> None:
    with blamed:
        rows = list(part.make())
    writer.append(rows)


class _Attempt:
    def __init__(self, episode: OpenEpisode, files: TrajectoryFiles) -> None:
        self.episode, self.files = episode, files
        self.has_parts = False
        self.began = time.monotonic()


class Recorder:
    """Writes trajectories of one run into one directory. Several recorders may share it; each is used by one thread.

    A trajectory is visible under `episodes/` from its commit on, whole, or never. Where anything goes wrong with one,
    that one is discarded and RecordError says why; the others, and what is committed, are untouched, and the next
    `start` begins afresh. What goes wrong on the recorder's thread is told by `PendingCommit.wait`, by the env's next
    `append` or `commit`, or by `close` at the latest.
    """

    def __init__(
        self,
        out: str | os.PathLike[str],
        writer: TrajectoryWriter,
        run: RunHeader,
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
        horizon: int = 512,
        sources: Mapping[str, StreamSource] = MappingProxyType({}),
    ) -> None:
        """Join the run in `out`, or begin it. Removes what recorders that died have left unfinished.

        Args:
            out: the run's directory; made if needed.
            writer: writes the trajectories; used by this recorder alone from here on.
            run: what is run. An existing directory must hold the same.
            now: the clock of `clock.created_at`.
            horizon: control steps for which room is made; longer episodes get more when they need it.
            sources: make streams of each episode that is committed, by name; closed with the recorder, also
                where it cannot be made.

        Raises:
            RecordError: the directory holds another run, or cannot be written.
        """
        self.out, self._now, self._writer, self._sources, self._closed = Path(out), now, writer, sources, False
        with ExitStack() as undo:
            undo.callback(close_sources, sources)
            self.run = RunHeader.model_validate({**dict(run), "spec": plain(run.spec, "spec")})
            self._attempts: dict[int, _Attempt] = {}
            self._store = ColumnStore(run.layout, horizon + 1)
            self._checks = BatchChecks(run.layout)
            self._committer = Committer(self.out, writer, self.run)
            self._streams = {name: info for source in sources.values() for name, info in source.streams.items()}
            try:
                self._incoming = Incoming(self.out)
                undo.callback(self._incoming.close)
                with self._incoming.startup():
                    describe_run(self.out, self._incoming.path, self.run)
            except OSError as error:
                raise disk_trouble(f"cannot record into {self.out}", error, self.out) from error
            undo.pop_all()

    @property
    def swept(self) -> tuple[str, ...]:
        """The unfinished trajectories of dead recorders that were removed at the start."""
        return self._incoming.swept

    @property
    def open_envs(self) -> tuple[int, ...]:
        """The envs whose episodes are open."""
        return tuple(sorted(self._attempts))

    @property
    def thread_ident(self) -> int | None:
        """The identifier of the recorder's thread, or None while it has not been needed."""
        return self._committer.thread_ident

    def committed(self) -> set[tuple[int, int]]:
        """(env, episode) of the trajectories that are there. Reads the directory: ask once, at the start."""
        found = (parse_trajectory(path.name) for path in trajectories(self.out))
        return {ids for ids in found if ids is not None}

    def is_committed(self, env: int, episode: int) -> bool:
        """Whether a trajectory is there. As quick among ten thousand others as alone."""
        return (self.out / EPISODES / trajectory_name(env, episode)).exists()

    @cached_property
    def _linear_algebra(self) -> str:
        return blas_kernel()

    # ------------------------------------------------------------------ one trajectory

    def start(self, episode: EpisodeHeader, film: Film | None = None) -> None:
        """Begin an episode of an env.

        Args:
            episode: what is known of it.
            film: draws its images, within `commit`; its frames have none then. None: they come with its frames.

        Raises:
            RecordError: it is committed already, the env has one open, or its header is no plain data.
        """
        env = episode.env
        self._require_open()
        if env in self._attempts:
            raise RecordError(
                f"env {env} has a trajectory open ({self._attempts[env].episode.where}); commit or discard it"
            )
        self._committer.refuse_taken(self._final(episode))
        values = {name: plain(getattr(episode, name), name) for name in ("drawn", "overridden")}
        header = Header(self.run, EpisodeHeader.model_validate({**dict(episode), **values}))
        files = TrajectoryFiles(self._incoming, self._writer, header, self.out, self._streams)
        attempt = self._attempts[env] = _Attempt(OpenEpisode(header, self._store.open(), film), files)
        if header.episode.cameras and film is None:
            self._open_images(attempt)
        for name, source in self._sources.items():
            with blame(name, source):
                source.begin(env)

    def cameras_due(self, env: int, step: int) -> tuple[str, ...]:
        """The cameras whose images belong to a control step of the env."""
        return self._attempt(env).episode.cameras_due(step)

    def append(self, env: int, frame: RecordedFrame) -> None:
        """Add one frame to the episode of an env. Its arrays may be used again by the caller.

        Raises:
            RecordError: it does not fit the header, or an earlier image could not be written; the trajectory is
                discarded.
        """
        attempt = self._attempt(env)
        try:
            batch = batch_of(attempt.episode, frame)
        except BaseException:
            self.discard(env)
            raise
        self.append_batch([env], batch)

    def append_batch(self, envs: Sequence[int], batch: FrameBatch) -> None:
        """Add one frame to the episodes of several envs. Arrays may be used again by the caller.

        Raises:
            RecordError: something does not fit the headers, or an earlier image could not be written. The trajectory
                at fault is discarded, and no other one has got its frame; it is all of them where it is an array.
        """
        attempts = [self._attempt(env) for env in envs]
        for row, (env, attempt) in enumerate(zip(envs, attempts, strict=True)):
            try:
                if attempt.files.trouble is not None:
                    raise attempt.files.trouble
                attempt.episode.check(batch.step[row], batch.images[row])
            except BaseException:
                self.discard(env)
                raise
        episodes = [attempt.episode for attempt in attempts]
        try:
            values = self._checks.values(episodes, batch)
            slots = np.array([episode.slot for episode in episodes], dtype=np.intp)
            rows = np.array([episode.count for episode in episodes], dtype=np.intp)
            self._store.write(slots, rows, values)
            for row, episode in enumerate(episodes):
                episode.note(
                    batch.step[row], batch.status[row], batch.annotations[row], batch.language[row], batch.images[row]
                )
        except BaseException:
            for env in envs:
                self.discard(env)
            raise
        for row, attempt in enumerate(attempts):
            if batch.images[row]:
                self._append_images(attempt, batch.step[row], batch.images[row])

    def commit(
        self, env: int, status: str, outcome: Mapping[str, Any] | None = None, clock: Mapping[str, Any] | None = None
    ) -> PendingCommit:
        """Complete the trajectory of an env: it is written, and made visible, on the recorder's thread.

        Args:
            env: whose trajectory.
            status: `success`, `failed`, `truncated`…
            outcome: further plain data about it, equal in equal runs.
            clock: further plain data that differs between equal runs.

        Raises:
            RecordError: its numbers are not finite, it has no steps, or an image could not be drawn or written; the
                trajectory is discarded.
        """
        attempt = self._attempt(env)
        try:
            if attempt.files.trouble is not None:
                raise attempt.files.trouble
            columns = attempt.episode.columns(self._store)
            check_columns(columns)
            if attempt.episode.film is not None:
                columns = self._filmed(attempt, columns, attempt.episode.film)
            if self._sources:
                self._follow(attempt, columns, status)
            now = {"created_at": self._now().isoformat(), "wall_s": round(time.monotonic() - attempt.began, 6)}
            here = {"linear_algebra": self._linear_algebra, **now}
            ending = Ending(status, plain(outcome or {}, "outcome"), {**plain(clock or {}, "clock"), **here})
        except BaseException:
            self.discard(env)
            raise
        self._forget(env)
        return self._committer.commit(self._final(columns.header.episode), attempt.files, columns, ending)

    def discard(self, env: int) -> None:
        """Forget the episode of an env, and remove what was written of it; fine if there is none."""
        attempt = self._attempts.get(env)
        if attempt is None:
            return
        self._forget(env)
        if attempt.has_parts:
            self._committer.abort(attempt.files)

    def flush(self) -> None:
        """Wait for the recorder's thread: whatever was committed is visible, or has failed, when this returns."""
        self._committer.flush()

    def close(self) -> None:
        """Discard what is open, wait for what was committed, and leave the directory. Further calls do nothing.

        Raises:
            RecordError: a commit failed that was not waited for; the first of them.
        """
        if self._closed:
            return
        self._closed = True
        try:
            for env in self.open_envs:
                self.discard(env)
        finally:
            self._committer.stop()
            self._incoming.close()
            close_sources(self._sources)
        self._committer.raise_untold()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, _: object) -> None:
        try:
            self.close()
        except RecordError:
            if error is None:  # else it is the error that ends the run that is told
                raise

    # ------------------------------------------------------------------ inside

    def _open_images(self, attempt: _Attempt) -> None:
        attempt.has_parts, header = True, attempt.episode.header
        self._committer.open_part(
            attempt.files, "images", lambda directory: self._writer.open_images(directory, header)
        )

    def _append_images(self, attempt: _Attempt, step: int, images: Mapping[str, Array]) -> None:
        copies = {name: np.array(image) for name, image in images.items()}
        self._committer.append_images(attempt.files, step, copies)

    def _filmed(self, attempt: _Attempt, columns: EpisodeColumns, film: Film) -> EpisodeColumns:
        """Draw the images of an episode that has ended, and hand each over: one is encoded while the next is drawn."""
        episode = attempt.episode
        self._open_images(attempt)
        for step in range(columns.first_step, columns.steps + 1):
            due = episode.cameras_due(step)
            if not due:
                continue
            images = film(columns, step, due)
            episode.check_images(step, images, due)
            if attempt.files.trouble is not None:
                raise attempt.files.trouble
            episode.note_images(step, images)
            self._append_images(attempt, step, images)
        return replace(columns, first_image=dict(episode.first_image))

    def _follow(self, attempt: _Attempt, columns: EpisodeColumns, status: str) -> None:
        """Hand over the streams of an episode that has ended, part by part: their rows are made on the other thread."""
        attempt.has_parts, files = True, attempt.files
        self._committer.open_part(
            files, "streams", lambda directory: self._writer.open_streams(directory, columns, self._streams)
        )
        for name, source in self._sources.items():
            with blame(name, source):
                for part in source.parts(columns.header.episode.env, columns, status):
                    if files.trouble is not None:
                        raise files.trouble
                    call = partial(_write_part, part, blame(name, source))
                    self._committer.append_to(files, "streams", f"the streams '{name}'", call, part.nbytes)

    def _forget(self, env: int) -> None:
        self._store.release(self._attempts.pop(env).episode.slot)

    def _final(self, episode: EpisodeHeader) -> Path:
        return self.out / EPISODES / trajectory_name(episode.env, episode.episode)

    def _require_open(self) -> None:
        if self._closed:
            raise RecordError(f"the recorder of {self.out} is closed; make another one")

    def _attempt(self, env: int) -> _Attempt:
        self._require_open()
        attempt = self._attempts.get(env)
        if attempt is None:
            raise RecordError(
                f"no trajectory of env {env} is being written (open: {listing(map(str, self.open_envs))}); "
                "call start() first"
            )
        return attempt

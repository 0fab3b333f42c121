"""The recorder of a run: starts, feeds, commits and discards the trajectories of its envs."""

import errno
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from anysim.errors import RecordError, listing
from anysim.record import commit as protocol
from anysim.record.episode import Episode
from anysim.record.frame import Frame
from anysim.record.header import EpisodeHeader, Header, RunHeader
from anysim.record.incoming import Incoming, remove
from anysim.record.json import dump_json, plain
from anysim.record.manifest import CameraEntry, Manifest, RunRecord, read_run
from anysim.record.names import (
    EPISODES,
    MANIFEST_FILE,
    RUN_FILE,
    checked_file_name,
    parse_trajectory,
    trajectories,
    trajectory_name,
)
from anysim.record.writer import TrajectoryWriter, WrittenFile


class _Attempt:
    def __init__(self, directory: Path, episode: Episode) -> None:
        self.directory = directory
        self.episode = episode
        self.began = time.monotonic()


class Recorder:
    """Writes trajectories of one run into one directory. Several recorders may share it; each is used by one thread.

    A trajectory is visible under `episodes/` from its commit on, whole, or never. Where anything goes wrong with one,
    that one is discarded and RecordError says why; the others, and what is committed, are untouched, and the next
    `start` begins afresh.
    """

    def __init__(
        self,
        out: str | os.PathLike[str],
        writer: Callable[[], TrajectoryWriter],
        run: RunHeader,
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        """Join the run in `out`, or begin it. Removes what recorders that died have left unfinished.

        Args:
            out: the run's directory; made if needed.
            writer: makes a fresh writer for each trajectory.
            run: what is run. An existing directory must hold the same.
            now: the clock of `clock.created_at`.

        Raises:
            RecordError: the directory holds another run, or cannot be written.
        """
        self.out = Path(out)
        self.run = RunHeader.model_validate({**dict(run), "spec": plain(run.spec, "spec")})
        self._writer = writer
        self._now = now
        self._attempts: dict[int, _Attempt] = {}
        self._closed = False
        try:
            self._incoming = Incoming(self.out)
        except OSError as error:
            raise RecordError(_trouble(f"cannot record into {self.out}", error, self.out)) from error
        try:
            with self._incoming.startup():
                self._describe_run()
        except OSError as error:
            self._incoming.close()
            raise RecordError(_trouble(f"cannot record into {self.out}", error, self.out)) from error
        except BaseException:
            self._incoming.close()
            raise

    @property
    def swept(self) -> tuple[str, ...]:
        """The unfinished trajectories of dead recorders that were removed at the start."""
        return self._incoming.swept

    @property
    def open_envs(self) -> tuple[int, ...]:
        """The envs whose trajectories are being written."""
        return tuple(sorted(self._attempts))

    def committed(self) -> set[tuple[int, int]]:
        """(env, episode) of the trajectories that are there, so that a resumed run can skip them."""
        found = (parse_trajectory(path.name) for path in trajectories(self.out))
        return {ids for ids in found if ids is not None}

    # ------------------------------------------------------------------ one trajectory

    def start(self, episode: EpisodeHeader) -> None:
        """Begin the trajectory of an env.

        Raises:
            RecordError: it is committed already, the env has one open, or its files cannot be made.
        """
        env = episode.env
        self._require_open()
        if env in self._attempts:
            raise RecordError(
                f"env {env} has a trajectory open ({self._attempts[env].episode.where}); commit or discard it"
            )
        final = self._final(episode)
        if final.exists():
            raise RecordError(_taken(final))
        values = {name: plain(getattr(episode, name), name) for name in ("drawn", "overridden")}
        episode = EpisodeHeader.model_validate({**dict(episode), **values})
        header = Header(self.run, episode)
        where = f"cannot begin env {env}, episode {episode.episode}"
        try:
            directory = self._incoming.attempt(env, episode.episode)
        except OSError as error:
            raise RecordError(_trouble(where, error, self.out)) from error
        attempt = _Attempt(directory, Episode(header, self._writer()))
        self._attempts[env] = attempt
        with self._guard(env, where):
            attempt.episode.writer.begin(directory, header)

    def cameras_due(self, env: int, step: int) -> tuple[str, ...]:
        """The cameras whose images belong to the frame of a control step of the env."""
        return self._attempt(env).episode.cameras_due(step)

    def append(self, env: int, frame: Frame) -> None:
        """Write one frame.

        Raises:
            RecordError: it does not fit the header, or could not be written; the trajectory is discarded.
        """
        episode = self._attempt(env).episode
        with self._guard(env, f"cannot write step {frame.step} of {episode.where}"):
            episode.append(frame)

    def commit(
        self, env: int, status: str, outcome: Mapping[str, Any] | None = None, clock: Mapping[str, Any] | None = None
    ) -> Path:
        """Complete the trajectory of an env and make it visible. Returns its directory.

        Args:
            env: whose trajectory.
            status: `success`, `failed`, `truncated`…
            outcome: further plain data about it, equal in equal runs.
            clock: further plain data that differs between equal runs.

        Raises:
            RecordError: it could not be completed; the trajectory is discarded.
        """
        attempt = self._attempt(env)
        final = self._final(attempt.episode.header.episode)
        with self._guard(env, f"cannot commit {attempt.episode.where}"):
            summary = attempt.episode.summary()
            written = attempt.episode.writer.finish(status)
            entries = protocol.seal(attempt.directory, [checked_file_name(file.name) for file in written])
            now = {"created_at": self._now().isoformat(), "wall_s": round(time.monotonic() - attempt.began, 6)}
            manifest = Manifest(
                **dict(attempt.episode.header.run),
                **{**dict(attempt.episode.header.episode), "cameras": _cameras(attempt.episode, written)},
                writer=attempt.episode.writer.name,
                status=status,
                steps=summary.steps,
                has_initial_frame=summary.has_initial_frame,
                initial_digest=summary.initial_digest,
                final_digest=summary.final_digest,
                outcome=plain(outcome or {}, "outcome"),
                files=entries,
                clock={**plain(clock or {}, "clock"), **now},
            )
            protocol.write_durably(attempt.directory / MANIFEST_FILE, dump_json(manifest.to_dict(), "manifest"))
            if not final.parent.exists():
                final.parent.mkdir(exist_ok=True)
                protocol.fsync(self.out)
            protocol.publish(attempt.directory, final)
        del self._attempts[env]
        return final

    def discard(self, env: int) -> None:
        """Forget the trajectory of an env, and remove what was written of it; fine if there is none."""
        attempt = self._attempts.pop(env, None)
        if attempt is None:
            return
        try:
            attempt.episode.writer.abort()
        finally:
            with suppress(OSError):  # what cannot be removed now is an orphan, which the next recorder sweeps
                remove(attempt.directory)

    def close(self) -> None:
        """Discard what is open and leave the directory. Further calls do nothing."""
        if self._closed:
            return
        self._closed = True
        try:
            for env in self.open_envs:
                self.discard(env)
        finally:
            self._incoming.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ------------------------------------------------------------------ inside

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

    @contextmanager
    def _guard(self, env: int, what: str) -> Iterator[None]:
        """Discards the trajectory when anything goes wrong inside, and turns an OSError into a RecordError."""
        try:
            yield
        except OSError as error:
            self.discard(env)
            if error.filename2 is not None and error.errno in (errno.ENOTEMPTY, errno.EEXIST):
                raise RecordError(_taken(Path(error.filename2))) from error
            raise RecordError(_trouble(what, error, self.out)) from error
        except BaseException:
            self.discard(env)
            raise

    def _describe_run(self) -> None:
        """Write run.json, or see that it says the same."""
        record = RunRecord.model_validate(dict(self.run))
        path = self.out / RUN_FILE
        if path.exists():
            theirs, ours = read_run(self.out).to_dict(), record.to_dict()
            differing = sorted(key for key in {*theirs, *ours} if theirs.get(key) != ours.get(key))
            if differing:
                raise RecordError(
                    f"{self.out} holds the trajectories of another run: {listing(differing)} differ"
                    f"{'s' if len(differing) == 1 else ''} from {path}; record into another directory"
                )
            return
        aside = self._incoming.path / RUN_FILE
        aside.unlink(missing_ok=True)
        try:
            protocol.write_durably(aside, dump_json(record.to_dict(), "run"))
            protocol.publish(aside, path)
        except OSError:
            aside.unlink(missing_ok=True)
            raise


def _cameras(episode: Episode, written: tuple[WrittenFile, ...]) -> dict[str, CameraEntry]:
    run, header = episode.header
    return {
        file.camera: CameraEntry(
            **dict(header.cameras[file.camera]),
            file=file.name,
            frames=file.frames,
            first_step=episode.first_image.get(file.camera, 0),
            fps=1.0 / (run.control_dt * header.cameras[file.camera].every),
        )
        for file in written
        if file.camera is not None
    }


def _taken(final: Path) -> str:
    return (
        f"{final} is committed already and is never overwritten; skip the ids in Recorder.committed(), "
        "or record into another directory"
    )


def _trouble(what: str, error: OSError, out: Path) -> str:
    """The sentence for a failed write: which path, how much space there is, what remains, what to do."""
    if error.errno in (errno.EMFILE, errno.ENFILE):
        remedy = "Allow more open files (ulimit -n), or record fewer envs at once: each has one, and one per camera"
    elif error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        remedy = "Make the directory writable, or record into another one"
    else:
        remedy = "Make room, or record into another directory, and start it again"
    path = error.filename or out
    existing = next((p for p in (out, *out.parents) if p.exists()), Path())
    try:
        free = f"{shutil.disk_usage(existing).free / 2**20:.1f} MiB are free there"
    except OSError:
        free = "its free space is unknown"
    return (
        f"{what}: {error.strerror or error} ({path}; {free}). What was unfinished of it is discarded, committed "
        f"trajectories are whole. {remedy}"
    )

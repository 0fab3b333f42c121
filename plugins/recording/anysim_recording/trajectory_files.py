"""The files of one trajectory, from its first image to the moment before its rename; all on the recorder's thread."""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from threading import Event
from typing import Any, NamedTuple, NoReturn

from anysim.record import commit as protocol
from anysim.record.columns import EpisodeColumns, where
from anysim.record.commit import disk_trouble
from anysim.record.frame import state_digest
from anysim.record.header import Header, RunHeader, StreamInfo
from anysim.record.incoming import Incoming, remove
from anysim.record.json import dump_json
from anysim.record.manifest import CameraEntry, Manifest, StreamEntry
from anysim.record.names import MANIFEST_FILE, checked_file_name
from anysim.record.writer import PartWriter, TrajectoryWriter, WrittenFile
from anysim.registry import blame, origin


class Ending(NamedTuple):
    """What is known of an episode when it is committed, beside its columns; the mappings are plain data."""

    status: str
    outcome: Mapping[str, Any]
    clock: Mapping[str, Any]


class PendingCommit:
    """A trajectory that was handed to the recorder's thread.

    Attributes:
        path: where it is once it is committed.
        told: whether its outcome has been reported.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.told = False
        self._done = Event()
        self._error: BaseException | None = None

    @property
    def done(self) -> bool:
        """Whether it is committed, or has failed."""
        return self._done.is_set()

    @property
    def failed(self) -> bool:
        """Whether it is done and could not be committed."""
        return self._error is not None

    def wait(self) -> Path:
        """Its directory, when it is there.

        Raises:
            RecordError: it could not be committed, and is discarded.
        """
        self._done.wait()
        self.told = True
        if self._error is not None:
            raise self._error
        return self.path

    def settle(self, error: BaseException | None) -> None:
        """Say how it came out; for the recorder's thread."""
        self._error = error
        self._done.set()


class ManifestText:
    """Writes manifests of a run. Most of one is the same in all of them, and is turned into text once."""

    def __init__(self, run: RunHeader, writer: str) -> None:
        self._run, self._writer = run, writer
        self._same = frozenset(RunHeader.model_fields)
        self._head = dump_json(run.model_dump(mode="json"), "manifest").removesuffix(b"\n}\n")

    def encode(self, columns: EpisodeColumns, ending: Ending, files: Mapping[str, Any], **others: Any) -> bytes:
        """The bytes of manifest.json; `others` are its `cameras` and `streams`."""
        whole = Manifest(
            **dict(self._run),
            **{**dict(columns.header.episode), **others},
            writer=self._writer,
            status=ending.status,
            steps=columns.steps,
            has_initial_frame=columns.first_step == 0,
            initial_digest=state_digest(columns.state_at(0)) if columns.first_step == 0 else None,
            final_digest=state_digest(columns.state_at(-1)),
            outcome=dict(ending.outcome),
            files=dict(files),
            clock=dict(ending.clock),
        )
        own = whole.model_dump(mode="json", exclude=set(self._same))
        return self._head + b",\n" + dump_json(own, "manifest").removeprefix(b"{\n")


class TrajectoryFiles:
    """The directory of one attempt. `trouble` is why its images could not be written, if so."""

    def __init__(
        self, incoming: Incoming, writer: TrajectoryWriter, header: Header, out: Path, streams: Mapping[str, StreamInfo]
    ) -> None:
        self._streams, self._incoming, self._writer, self._header, self._out = streams, incoming, writer, header, out
        self._parts: dict[str, PartWriter] = {}
        self.directory: Path | None = None
        self.trouble: BaseException | None = None

    @property
    def where(self) -> str:
        """`env 3, episode 2`, for messages."""
        return where(self._header)

    def open_part(self, kind: str, call: Callable[[Path], PartWriter]) -> None:
        """Begin the trajectory's directory for the `images` or `streams` to come."""

        def begin() -> None:
            self._parts[kind] = call(self._made())

        self._guarded(f"cannot begin {self.where}", begin)

    def append_to(self, kind: str, what: str, call: Callable[[Any], None]) -> None:
        """Hand something to the writer of a part."""
        if self.trouble is None and kind in self._parts:
            self._guarded(f"cannot write {what} of {self.where}", lambda: call(self._parts[kind]))

    def write(self, columns: EpisodeColumns, ending: Ending, text: ManifestText) -> Path:
        """Write everything aside and bring it to the disk. Returns the directory, ready to be renamed.

        Raises:
            RecordError: it could not be written.
        """
        if self.trouble is not None:
            raise self.trouble
        try:
            directory = self._made()
            written = self._writer.write(directory, columns, ending.status)
            for kind in tuple(self._parts):
                written += self._parts[kind].finish()
                del self._parts[kind]
            entries = protocol.seal(directory, [checked_file_name(file.name) for file in written])
            cameras = camera_entries(columns.header, columns.first_image, written)
            streams = {
                name: StreamEntry(**dict(self._streams[name]), file=file.name, rows=count)
                for file in written
                for name, count in file.streams.items()
            }
            manifest = text.encode(columns, ending, entries, cameras=cameras, streams=streams)
            protocol.write_durably(directory / MANIFEST_FILE, manifest)
        except OSError as error:
            raise disk_trouble(f"cannot commit {self.where}", error, self._out) from error
        except BaseException as error:  # noqa: BLE001 - told in a sentence
            self._blame(f"cannot commit {self.where}", error)
        return directory

    def abort(self) -> None:
        """Remove everything; what cannot be removed now is an orphan, which the next recorder sweeps."""
        parts, self._parts = self._parts, {}
        try:
            for part in parts.values():
                part.abort()
        finally:
            if self.directory is not None:
                with suppress(OSError):
                    remove(self.directory)

    def _made(self) -> Path:
        if self.directory is None:
            episode = self._header.episode
            self.directory = self._incoming.attempt(episode.env, episode.episode)
        return self.directory

    def _guarded(self, what: str, call: Callable[[], None]) -> None:
        try:
            call()
        except OSError as error:
            self.trouble = disk_trouble(what, error, self._out)
            self.trouble.__cause__ = error
        except BaseException as error:  # noqa: BLE001  raised at the next append or commit
            try:
                self._blame(what, error)
            except BaseException as told:  # noqa: BLE001
                self.trouble = told

    def _blame(self, what: str, error: BaseException) -> NoReturn:
        writer = f"{what}: the writer '{self._writer.name}'"
        blame(error, writer, origin(self._writer))


def camera_entries(
    header: Header, first_image: Mapping[str, int], written: Iterable[WrittenFile]
) -> dict[str, CameraEntry]:
    """What a manifest says of the cameras whose videos were written; a camera that took no image has none."""
    run, episode = header
    return {
        file.camera: CameraEntry(
            **dict(episode.cameras[file.camera]),
            file=file.name,
            frames=file.frames,
            first_step=first_image.get(file.camera, 0),
            fps=1.0 / (run.control_dt * episode.cameras[file.camera].every),
        )
        for file in written
        if file.camera is not None
    }

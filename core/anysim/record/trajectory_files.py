"""The files of one trajectory, from its first image to the moment before its rename; all on the recorder's thread."""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from threading import Event
from typing import Any, NamedTuple, NoReturn

from anysim.conventions import Array
from anysim.record import commit as protocol
from anysim.record.columns import EpisodeColumns, where
from anysim.record.commit import disk_trouble
from anysim.record.frame import state_digest
from anysim.record.header import Header, RunHeader
from anysim.record.incoming import Incoming, remove
from anysim.record.json import dump_json
from anysim.record.manifest import CameraEntry, Manifest
from anysim.record.names import MANIFEST_FILE, checked_file_name
from anysim.record.writer import ImageWriter, TrajectoryWriter, WrittenFile
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

    def encode(self, columns: EpisodeColumns, ending: Ending, files: Mapping[str, Any], cameras: Any) -> bytes:
        """The bytes of manifest.json."""
        whole = Manifest(
            **dict(self._run),
            **{**dict(columns.header.episode), "cameras": cameras},
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

    def __init__(self, incoming: Incoming, writer: TrajectoryWriter, header: Header, out: Path) -> None:
        self._incoming, self._writer, self._header, self._out = incoming, writer, header, out
        self._images: ImageWriter | None = None
        self.directory: Path | None = None
        self.trouble: BaseException | None = None

    @property
    def where(self) -> str:
        """`env 3, episode 2`, for messages."""
        return where(self._header)

    def open_images(self) -> None:
        """Begin the trajectory's directory for the images to come."""
        what = f"cannot begin {self.where}"
        self._guarded(what, lambda: self._writer.open_images(self._made(), self._header), keep=True)

    def append_images(self, step: int, images: Mapping[str, Array]) -> None:
        """Write the images of a control step."""
        writer = self._images
        if self.trouble is None and writer is not None:
            what = f"cannot write step {step} of {self.where}"
            self._guarded(what, lambda: writer.append(images))

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
            if self._images is not None:
                written += self._images.finish()
                self._images = None
            entries = protocol.seal(directory, [checked_file_name(file.name) for file in written])
            cameras = camera_entries(columns.header, columns.first_image, written)
            manifest = text.encode(columns, ending, entries, cameras)
            protocol.write_durably(directory / MANIFEST_FILE, manifest)
        except OSError as error:
            raise disk_trouble(f"cannot commit {self.where}", error, self._out) from error
        except BaseException as error:  # noqa: BLE001 - told in a sentence
            self._blame(f"cannot commit {self.where}", error)
        return directory

    def abort(self) -> None:
        """Remove everything; what cannot be removed now is an orphan, which the next recorder sweeps."""
        images, self._images = self._images, None
        try:
            if images is not None:
                images.abort()
        finally:
            if self.directory is not None:
                with suppress(OSError):
                    remove(self.directory)

    def _made(self) -> Path:
        if self.directory is None:
            episode = self._header.episode
            self.directory = self._incoming.attempt(episode.env, episode.episode)
        return self.directory

    def _guarded(self, what: str, call: Callable[[], Any], keep: bool = False) -> None:
        try:
            made = call()
            if keep:
                self._images = made
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

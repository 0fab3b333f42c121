"""The contract of a record writer: a plugin of the kind `writers` that turns whole episodes into files.

A writer of numbers alone is one method:

    class NpzWriter(TrajectoryWriter):
        name = "npz"

        def write(self, directory, columns, status):
            np.savez(directory / "trajectory.npz", time=columns.time, action=columns.action, **columns.state)
            return (WrittenFile("trajectory.npz"),)
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

from anysim import registry
from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.columns import EpisodeColumns
from anysim.record.header import Header, RunHeader, StreamInfo
from anysim.record.streams import StreamRow


class WrittenFile(NamedTuple):
    """A file that a writer made in its directory. `camera`, `frames`: of a video; `streams`: how many rows of each."""

    name: str
    camera: str | None = None
    frames: int = 0
    streams: Mapping[str, int] = MappingProxyType({})


Content = TypeVar("Content")


class PartWriter(ABC, Generic[Content]):
    """Writes something of one trajectory as it comes: `append`…, then `finish` or `abort`. Used once."""

    @abstractmethod
    def append(self, content: Content, /) -> None:
        """Write what comes next; steps come in order."""

    @abstractmethod
    def finish(self) -> tuple[WrittenFile, ...]:
        """Complete and close the files, and say which there are."""

    @abstractmethod
    def abort(self) -> None:
        """Close whatever is open, in whatever state, without raising an OSError. May be called after any failure."""


ImageWriter = PartWriter[Mapping[str, Array]]
"""Writes the images (H, W, 3) uint8 of the cameras that are due at a control step."""
StreamWriter = PartWriter[Sequence[StreamRow]]
"""Checks and writes rows of streams; within a family steps come in order."""


class TrajectoryWriter(ABC):
    """Writes the trajectories of a run, each at once when it has ended, into a directory of its own.

    What is written must follow from columns and images alone: no wall clock, no process id, no random names. An
    OSError (a full disk) may come out of any method, which closes its own files then; the recorder removes the
    directory. All methods but the constructor are called on one thread.
    """

    name: ClassVar[str]
    """The name under which the reader of its files is installed (kind `readers`)."""

    @classmethod
    def options_model(cls) -> Any:
        """The pydantic model of the writer's options (`record.options`), or None if it has none."""
        return None

    def prepare(self, run: RunHeader) -> None:
        """Make what all trajectories of the run have in common. Called once, before the first of them."""

    @abstractmethod
    def write(self, directory: Path, columns: EpisodeColumns, status: str) -> tuple[WrittenFile, ...]:
        """Write an episode into a new directory, and say which files there are. `status` is how it came out."""

    def open_images(self, directory: Path, header: Header) -> ImageWriter:
        """What writes the images of one trajectory; called before its first one, where cameras are recorded.

        Raises:
            RecordError: this writer takes no images.
        """
        raise RecordError(
            f"the writer '{self.name}' writes no images of {', '.join(header.episode.cameras)}; "
            "set record.cameras=[], or choose another record.writer"
        )

    def open_streams(self, directory: Path, columns: EpisodeColumns, streams: Mapping[str, StreamInfo]) -> StreamWriter:
        """What writes the streams of one trajectory, whose numbers are given; called where there are any.

        Raises:
            RecordError: this writer takes no streams.
        """
        raise RecordError(
            f"the writer '{self.name}' writes no streams ({', '.join(streams)}); leave them out of record"
        )


def make_writer(name: str, options: Mapping[str, Any]) -> TrajectoryWriter:
    """A writer by its installed name, with the options of `record.options`.

    Raises:
        PluginError: no such writer is installed (says what to install).
        RecordError: an option is wrong.
    """
    made = registry.load("writers", name)
    with registry.using("writers", name):
        return made(**options)

"""What a record writer is: a plugin of the kind `writers` that turns frames into files."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Protocol

from anysim import registry
from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.frame import Frame
from anysim.record.header import CameraInfo, Header


class WrittenFile(NamedTuple):
    """A file that a writer made in its directory. `camera`, `frames`: of a video."""

    name: str
    camera: str | None = None
    frames: int = 0


class Video(Protocol):
    """A video while it is written."""

    frames: int
    """How many images it has."""

    def write(self, image: Array) -> None:
        """Add the next image (H, W, 3) uint8."""
        ...

    def close(self) -> None:
        """Complete the file."""
        ...

    def abort(self) -> None:
        """Close the file in whatever state, without raising an OSError."""
        ...


class TrajectoryWriter(ABC):
    """Writes one trajectory into one directory: begin, append…, then finish or abort. Used once.

    What is written must follow from header and frames alone: no wall clock, no process id, no random names. An OSError
    (a full disk) may come out of any method; the recorder then calls `abort` and removes the directory. Frames come
    checked: names, shapes, order and types are those of the header. A writer keeps no reference to a frame's arrays.
    """

    name: ClassVar[str]
    """The name under which the reader of its files is installed (kind `readers`)."""

    @classmethod
    def options_model(cls) -> Any:
        """The pydantic model of the writer's options (`record.options`), or None if it has none."""
        return None

    @abstractmethod
    def begin(self, directory: Path, header: Header) -> None:
        """Open the files."""

    @abstractmethod
    def append(self, frame: Frame) -> None:
        """Write one frame."""

    @abstractmethod
    def finish(self, status: str) -> tuple[WrittenFile, ...]:
        """Complete and close the files, and say which there are. `status` is the trajectory's outcome."""

    @abstractmethod
    def abort(self) -> None:
        """Close whatever is open, in whatever state, without raising an OSError. May be called after any failure."""

    # ------------------------------------------------------------------ videos by themselves

    def video_file(self, camera: str) -> str:
        """The name of the file that a camera's video has beside the others of a trajectory."""
        raise self._no_videos()

    def open_video(self, path: Path, camera: CameraInfo, control_dt: float) -> Video:
        """Begin a camera's video by itself: the file that `append` would have made of the same images.

        Raises:
            RecordError: the writer has none.
        """
        raise self._no_videos()

    def _no_videos(self) -> RecordError:
        return RecordError(f"the writer '{self.name}' cannot write a video by itself; record with `record.film: live`")


def writer_factory(name: str, options: Mapping[str, Any]) -> Callable[[], TrajectoryWriter]:
    """What a Recorder takes: makes a fresh writer by its installed name, with the options of `record.options`.

    Raises:
        PluginError: no such writer is installed (says what to install).
        RecordError: an option is wrong; found here and not at the first trajectory.
    """
    factory: Callable[[], TrajectoryWriter] = partial(registry.load("writers", name), **options)
    factory()
    return factory

"""What a record writer is: a plugin of the kind `writers` that turns frames into files."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from anysim import registry
from anysim.record.frame import Frame
from anysim.record.header import Header


class WrittenFile(NamedTuple):
    """A file that a writer made in its directory. `camera`, `frames`: of a video."""

    name: str
    camera: str | None = None
    frames: int = 0


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


def writer_factory(name: str, options: Mapping[str, Any]) -> Callable[[], TrajectoryWriter]:
    """What a Recorder takes: makes a fresh writer by its installed name, with the options of `record.options`.

    Raises:
        PluginError: no such writer is installed (says what to install).
        RecordError: an option is wrong; found here and not at the first trajectory.
    """
    factory: Callable[[], TrajectoryWriter] = partial(registry.load("writers", name), **options)
    factory()
    return factory

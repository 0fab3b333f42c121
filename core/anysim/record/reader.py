"""Reading a committed trajectory, with nothing but its directory."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from anysim import registry
from anysim.conventions import Array
from anysim.record.manifest import Manifest, read_manifest


class TrajectoryReader(ABC):
    """A committed trajectory of T steps. Row t of every array belongs to control step t + 1.

    What a reader gets is not trusted: sizes and names are checked, nothing is unpickled, and damage is a RecordError.
    """

    def __init__(self, directory: Path, manifest: Manifest | None = None) -> None:
        """`manifest`: that of the directory, if it was read already."""
        self.directory = Path(directory)
        self.manifest = read_manifest(self.directory) if manifest is None else manifest

    @property
    @abstractmethod
    def times(self) -> Array:
        """(T,) simulated time after each step [s]."""

    @property
    @abstractmethod
    def actions(self) -> Array:
        """(T, A) float64."""

    @property
    @abstractmethod
    def states(self) -> Mapping[str, Array]:
        """(T, …) float64, after each step."""

    @property
    @abstractmethod
    def initial_state(self) -> Mapping[str, Array]:
        """(…) float64, right after the reset; empty if it was not recorded."""

    @property
    @abstractmethod
    def obs(self) -> Mapping[str, Array]:
        """(T, …) float32 or float64, after each step."""

    @property
    @abstractmethod
    def initial_obs(self) -> Mapping[str, Array]:
        """(…) right after the reset; empty if it was not recorded."""

    @property
    @abstractmethod
    def rewards(self) -> Array:
        """(T,) float64."""

    @property
    @abstractmethod
    def statuses(self) -> tuple[str, ...]:
        """T of them."""

    @property
    @abstractmethod
    def annotations(self) -> tuple[Mapping[str, Any], ...]:
        """T of them: what held at each step."""

    @property
    @abstractmethod
    def language(self) -> tuple[str, ...]:
        """T of them: the instruction in force at each step."""

    @abstractmethod
    def images(self, camera: str) -> Iterator[tuple[int, Array]]:
        """(control step, (H, W, 3) uint8) of a camera, in order, decoded one at a time."""

    @abstractmethod
    def faults(self) -> list[str]:
        """Everything wrong that only a look into the files shows, as sentences; empty if all is well."""


def open_trajectory(directory: str | Path) -> TrajectoryReader:
    """The reader of a committed trajectory, by the writer that its manifest names.

    Raises:
        RecordError: the manifest is missing, damaged or of another format.
        PluginError: the reader is not installed (says what to install).
    """
    path = Path(directory)
    manifest = read_manifest(path)
    reader: TrajectoryReader = registry.load("readers", manifest.writer)(path, manifest)
    return reader

"""A record writer of plain numpy files, and the reader of what it writes."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.columns import Change, EpisodeColumns
from anysim.record.manifest import Manifest
from anysim.record.reader import TrajectoryReader
from anysim.record.writer import TrajectoryWriter, WrittenFile

FILE = "trajectory.npz"


class NpzWriter(TrajectoryWriter):
    """One .npz file an episode: numbers alone, no images."""

    name = "starter_npz"

    def write(self, directory: Path, columns: EpisodeColumns, status: str) -> tuple[WrittenFile, ...]:
        """All columns of the episode, by names like `state/joint_pos`."""
        arrays = {"time": columns.time, "action": columns.action, "reward": columns.reward}
        arrays |= {f"state/{name}": rows for name, rows in columns.state.items()}
        arrays |= {f"obs/{name}": rows for name, rows in columns.obs.items()}
        instruction = Change(0, columns.header.episode.instruction)
        changes = {
            "status": columns.status,
            "annotations": (Change(0, {}), *columns.annotations),
            "language": (instruction, *columns.language),
        }
        arrays |= {f"changes/{name}": np.array(json.dumps(list(values))) for name, values in changes.items()}
        np.savez(directory / FILE, first_step=columns.first_step, **arrays)
        return (WrittenFile(FILE),)


class NpzReader(TrajectoryReader):
    """Reads the file whole: what is in it is as large as what was recorded."""

    def __init__(self, directory: Path, manifest: Manifest | None = None) -> None:
        super().__init__(directory, manifest)
        try:
            with np.load(self.directory / FILE, allow_pickle=False) as file:  # never unpickle what comes from a file
                self._arrays = {name: file[name] for name in file.files}
        except (OSError, ValueError, KeyError) as error:
            raise RecordError(f"{self.directory / FILE} cannot be read: {error}") from error
        self._first = 1 - int(self._arrays["first_step"])  # the row of control step 1

    @property
    def times(self) -> Array:
        return self._arrays["time"][self._first :]

    @property
    def actions(self) -> Array:
        return self._arrays["action"][self._first :]

    @property
    def rewards(self) -> Array:
        return self._arrays["reward"][self._first :]

    @property
    def states(self) -> Mapping[str, Array]:
        return {name: rows[self._first :] for name, rows in self._under("state/").items()}

    @property
    def initial_state(self) -> Mapping[str, Array]:
        return {name: rows[0] for name, rows in self._under("state/").items()} if self._first else {}

    @property
    def obs(self) -> Mapping[str, Array]:
        return {name: rows[self._first :] for name, rows in self._under("obs/").items()}

    @property
    def initial_obs(self) -> Mapping[str, Array]:
        return {name: rows[0] for name, rows in self._under("obs/").items()} if self._first else {}

    @property
    def statuses(self) -> tuple[str, ...]:
        return self._held("status")

    @property
    def annotations(self) -> tuple[Mapping[str, Any], ...]:
        return self._held("annotations")

    @property
    def language(self) -> tuple[str, ...]:
        return self._held("language")

    def images(self, camera: str) -> Iterator[tuple[int, Array]]:
        raise RecordError(f"{self.directory} has no images of '{camera}': the writer starter_npz takes none")

    def faults(self) -> list[str]:
        lengths = {name: len(rows) for name, rows in self._arrays.items() if rows.ndim}
        return [] if len(set(lengths.values())) == 1 else [f"arrays of different lengths: {lengths}"]

    def _held(self, name: str) -> tuple[Any, ...]:
        """What held at each step: changes, written out."""
        changes: Sequence[tuple[int, Any]] = json.loads(str(self._arrays[f"changes/{name}"]))
        values: list[Any] = []
        for (row, value), following in zip(changes, [*changes[1:], (len(self._arrays["time"]), None)], strict=True):
            values += [value] * (following[0] - row)
        return tuple(values[self._first :])

    def _under(self, prefix: str) -> dict[str, Array]:
        return {name.removeprefix(prefix): rows for name, rows in self._arrays.items() if name.startswith(prefix)}

"""Reading a committed trajectory, with nothing but its directory: arrays, images, and the world at any step."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from anysim import registry
from anysim.conventions import Array
from anysim.engine.control import Control
from anysim.engine.snapshots.world_state import WorldState
from anysim.errors import RecordError, listing, suggest
from anysim.record.manifest import Manifest, read_manifest
from anysim.record.streams import StreamRow


class StreamRows(NamedTuple):
    """Rows of a stream: control steps (K,), times (K,) [s], and values: (K, …), or K of them where sizes differ."""

    steps: Array
    times: Array
    values: Any


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
        """(T, …) in the types of the layout, after each step."""

    @property
    @abstractmethod
    def initial_state(self) -> Mapping[str, Array]:
        """(…) in the types of the layout, right after the reset; empty if it was not recorded."""

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

    def states_from_reset(self, name: str) -> Array:
        """(T+1, …) a state array, the row of the reset first."""
        return np.concatenate([self.initial_state[name][None], self.states[name]])

    def obs_from_reset(self, name: str) -> Array:
        """(T+1, …) an observation group, the row of the reset first: all but the last is what actions followed."""
        return np.concatenate([self.initial_obs[name][None], self.obs[name]])

    @abstractmethod
    def images(self, camera: str) -> Iterator[tuple[int, Array]]:
        """(control step, (H, W, 3) uint8) of a camera, in order, decoded one at a time."""

    def columns(self) -> dict[str, Any]:
        """What every trajectory holds, by names of streams: from step 1 on, or from the reset where that is known."""
        found: dict[str, Any] = {"action": self.actions, "annotation": self.annotations, "language": self.language}
        found |= {"collect/reward": self.rewards, "collect/status": self.statuses}
        whole, seen = self.initial_state, self.initial_obs
        found |= {f"state/{k}": self.states_from_reset(k) if k in whole else rows for k, rows in self.states.items()}
        return found | {f"observation/{k}": self.obs_from_reset(k) if k in seen else v for k, v in self.obs.items()}

    def names(self) -> tuple[str, ...]:
        """The streams that `stream` gives."""
        return (*self.columns(), *(f"camera/{name}" for name in self.manifest.cameras), *self.manifest.streams)

    def stream(self, name: str) -> StreamRows:
        """A stream by its name, whole.

        Raises:
            RecordError: there is no such stream, or it is damaged.
        """
        values, names = self.columns().get(name), self.names()
        if name not in names:
            raise RecordError(f"{self.directory} has no stream '{name}'{suggest(name, names)} ({listing(names)})")
        steps = np.arange(self.manifest.steps + 1 - (0 if values is None else len(values)), self.manifest.steps + 1)
        if values is None:
            rows, entry = list(self.rows(name)), self.manifest.streams.get(name)
            steps, values = np.array([row.step for row in rows], dtype=np.int64), [row.value for row in rows]
            if rows and (entry is None or (entry.kind not in ("text", "data") and None not in entry.shape)):
                values = np.stack(values)
        return StreamRows(steps, self.times_from_reset[steps], values)

    def rows(self, name: str) -> Iterator[StreamRow]:
        """The rows of `camera/NAME` or of a stream of the manifest, one at a time."""
        for step, image in self.images(name.removeprefix("camera/")):
            yield StreamRow(name, step, image, float(self.times_from_reset[step]))

    @property
    def times_from_reset(self) -> Array:
        """(T+1,) simulated time after each step [s], 0 at the reset."""
        return np.concatenate([[0.0], self.times])

    @abstractmethod
    def faults(self) -> list[str]:
        """Everything wrong that only a look into the files shows, as sentences; empty if all is well."""

    def nonsense(self) -> list[str]:
        """What no recorder writes although every file can be read, as sentences: numbers and steps.

        Raises:
            RecordError: a file cannot be read.
        """
        steps, layout, found = self.manifest.steps, self.manifest.layout, list[str]()
        shapes = {f"the state '{name}'": (self.states.get(name), shape) for name, shape in layout.state.items()}
        shapes |= {f"the observation '{name}'": (self.obs.get(name), a.shape) for name, a in layout.obs.items()}
        shapes |= {"the times": (self.times, ()), "the rewards": (self.rewards, ())}
        shapes |= {"the actions": (self.actions, (len(layout.action),))}
        for name, (array, shape) in shapes.items():
            if array is None or array.shape != (steps, *shape):
                held = "nothing" if array is None else array.shape
                found.append(f"{self.directory}: {name} should have the shape {(steps, *shape)}, and hold {held}")
            elif not name.startswith("the observation") and not np.isfinite(array).all():
                step = 1 + int(np.argmin(np.isfinite(array).reshape(steps, -1).all(axis=1)))
                found.append(f"{self.directory}: {name} are not finite at step {step}")
        times = self.times
        if (times < 0.0).any() or (np.diff(times) < 0.0).any():
            step = 2 + int(np.argmin(np.diff(times) >= 0.0)) if (np.diff(times) < 0.0).any() else 1
            found.append(f"{self.directory}: time goes back at step {step}")
        counts = {"statuses": self.statuses, "annotations": self.annotations, "instructions": self.language}
        return found + [
            f"{self.directory} has {len(rows)} {name} of {steps} steps"
            for name, rows in counts.items()
            if len(rows) != steps
        ]


def open_trajectory(directory: str | Path) -> TrajectoryReader:
    """The reader of a committed trajectory, by the writer that its manifest names.

    Raises:
        RecordError: the manifest is missing, damaged or of another format; a file is a pipe or a device.
        PluginError: the reader is not installed (says what to install).
    """
    path = Path(directory)
    manifest = read_manifest(path)
    for name in manifest.files:
        if (path / name).is_symlink() or ((path / name).exists() and not (path / name).is_file()):
            raise RecordError(f"{path / name} is not a plain file; a recorder writes no other")
    made: type[TrajectoryReader] = registry.load("readers", manifest.writer)
    with registry.using("readers", manifest.writer):
        return made(path, manifest)


_MOTION = ("body_pose", "body_twist", "joint_pos", "joint_vel")
_COMMANDS = tuple(f"control_{name}" for name in Control._fields if name != "mode")


def world_state(reader: TrajectoryReader, step: int) -> WorldState:
    """One env after a control step; step 0 is right after the reset.

    A recording holds motions and position commands. What was drawn, such as a mass, is in its manifest: reset an env
    with its episode seed before this state is written into it.

    Raises:
        RecordError: there is no such step, or the recording lacks a state array that this needs.
    """
    layout = reader.manifest.layout
    lacking = [name for name in _MOTION if name not in layout.state]
    if lacking:
        raise RecordError(f"{reader.directory} does not hold {listing(lacking)}, which a world state needs")
    if not 0 <= step <= reader.manifest.steps or (step == 0 and not reader.initial_state):
        first = 0 if reader.initial_state else 1
        raise RecordError(f"{reader.directory} has the steps {first} to {reader.manifest.steps}, not {step}")
    arrays = reader.initial_state if step == 0 else {name: rows[step - 1] for name, rows in reader.states.items()}
    rows = {name: np.array(arrays[name], dtype=float)[None] for name in _MOTION}
    commands: dict[str, Any] = {}
    if "control_position" in layout.state:
        none = np.zeros(len(layout.actuators))
        commands = {name: np.array(arrays.get(name, none), dtype=float)[None] for name in _COMMANDS}
        commands["control_mode"] = np.full((1, len(layout.actuators)), "position")
    time = 0.0 if step == 0 else float(reader.times[step - 1])
    return WorldState(
        time=np.array([time]),
        entities=(),
        present=np.zeros((1, 0), dtype=bool),
        bodies=layout.bodies,
        body_pose=rows["body_pose"],
        body_twist=rows["body_twist"],
        joints=layout.joints,
        joint_pos=rows["joint_pos"],
        joint_vel=rows["joint_vel"],
        actuators=layout.actuators if commands else (),
        **commands,
    )

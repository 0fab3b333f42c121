"""The reader of what the writer `mcap` wrote."""

import json
import math
from collections.abc import Iterator, Mapping
from functools import cached_property
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError, listing, suggest
from anysim.record.frame import state_digest
from anysim.record.manifest import CameraEntry
from anysim.record.reader import TrajectoryReader
from anysim.record.streams import StreamRow
from anysim_mcap import messages as m, video
from anysim_mcap.chunks import records
from anysim_mcap.drawn_faults import drawn_faults
from anysim_mcap.streams import read_rows, stream_faults
from anysim_mcap.writer import TRAJECTORY_FILE

_SCHEMAS = {"/action": m.ACTION, "/state": m.STATE, "/collect": m.COLLECT}
_WORDS = {"/annotation": "annotations", "/language": "text"}


class _Rows(NamedTuple):
    """What the file holds; lists by step, the first row of states and collects is step 0 where that was recorded."""

    action: list[Array]
    time: list[float]
    state: dict[str, list[Array]]
    reward: list[float]
    status: list[str]
    obs: dict[str, list[Array]]
    words: dict[str, dict[int, Any]]


class McapReader(TrajectoryReader):
    """See TrajectoryReader. The file is read, with all its checksums, when the first array is asked for."""

    @property
    def _path(self) -> Any:
        return self.directory / TRAJECTORY_FILE

    @property
    def _skip(self) -> int:
        """Rows of states and collects before step 1."""
        return int(self.manifest.has_initial_frame)

    @cached_property
    def times(self) -> Array:
        return np.array(self._rows.time[self._skip :], dtype=np.float64)

    @cached_property
    def actions(self) -> Array:
        rows = self._rows.action  # their number and width both count: a robot without channels has no action
        return np.array(rows, dtype=np.float64).reshape(len(rows), len(self.manifest.layout.action))

    @cached_property
    def states(self) -> Mapping[str, Array]:
        return {name: np.stack(rows[self._skip :]) for name, rows in self._rows.state.items()}

    @property
    def initial_state(self) -> Mapping[str, Array]:
        return {name: rows[0] for name, rows in self._rows.state.items()} if self._skip else {}

    @cached_property
    def obs(self) -> Mapping[str, Array]:
        return {name: np.stack(rows[self._skip :]) for name, rows in self._rows.obs.items()}

    @property
    def initial_obs(self) -> Mapping[str, Array]:
        return {name: rows[0] for name, rows in self._rows.obs.items()} if self._skip else {}

    @cached_property
    def rewards(self) -> Array:
        return np.array(self._rows.reward[self._skip :], dtype=np.float64)

    @cached_property
    def statuses(self) -> tuple[str, ...]:
        return tuple(self._rows.status[self._skip :])

    @cached_property
    def annotations(self) -> tuple[Mapping[str, Any], ...]:
        return self._held("/annotation", {})

    @cached_property
    def language(self) -> tuple[str, ...]:
        return self._held("/language", "")

    def images(self, camera: str) -> Iterator[tuple[int, Array]]:
        entry = self._camera(camera)
        for number, image in enumerate(video.images(self.directory / entry.file, entry.width, entry.height)):
            yield entry.first_step + number * entry.every, image

    def rows(self, name: str) -> Iterator[StreamRow]:
        if name not in self.manifest.streams:
            yield from super().rows(name)
            return
        entry = self.manifest.streams[name]
        for row in read_rows(self.directory / entry.file, {name: entry}, self.manifest.steps):
            yield row._replace(time=float(self.times_from_reset[row.step]))

    def faults(self) -> list[str]:
        found: list[str] = []
        try:
            last = {name: rows[-1] for name, rows in self.states.items()}
            if state_digest(last) != self.manifest.final_digest:
                found.append(f"{self._path}: the last state is not the one that the manifest describes")
            if self._skip and state_digest(self.initial_state) != self.manifest.initial_digest:
                found.append(f"{self._path}: the initial state is not the one that the manifest describes")
            found += self._contradictions() or self._drawn()
        except RecordError as error:
            found.append(str(error))
        if not found:
            found += stream_faults(self.directory, self.manifest.streams, self.times_from_reset)
        for entry in self.manifest.cameras.values():
            path = self.directory / entry.file
            try:
                video.check(path, entry.width, entry.height, entry.frames, entry.fps)
            except RecordError as error:
                found.append(str(error))
        return found

    # ------------------------------------------------------------------ inside

    def _contradictions(self) -> list[str]:
        """What the file says of itself otherwise than the manifest, and messages that were logged at another time."""
        facts = self._facts.get("anysim/trajectory", {})
        names = ("task", "seed", "env", "episode", "episode_seed", "engine", "engine_version", "world_hash")
        differing = [name for name in names if name in facts and facts[name] != str(getattr(self.manifest, name))]
        found = [f"{self._path} says another {listing(differing)} than the manifest"] if differing else []
        return found + ([f"{self._path}: {self._untimely[0]}"] if self._untimely else [])

    def _drawn(self) -> list[str]:
        """What the file says otherwise to those who draw it."""
        poses = self.states.get("body_pose", np.empty((self.manifest.steps, 0, 7)))
        first = self.initial_state.get("body_pose", np.full(poses.shape[1:], np.nan))
        rows = np.concatenate([first[None], poses])
        return drawn_faults(self._path, self.manifest.layout, rows, self.times_from_reset, self.manifest.cameras)

    def _camera(self, name: str) -> CameraEntry:
        entry = self.manifest.cameras.get(name)
        if entry is None:
            names = sorted(self.manifest.cameras)
            raise RecordError(
                f"{self.directory} has no camera '{name}'{suggest(name, names)} (cameras: {listing(names)})"
            )
        return entry

    def _held(self, topic: str, value: Any) -> tuple[Any, ...]:
        """The value in force at steps 1 to T."""
        events = self._rows.words[topic]
        steps = range(self.manifest.steps + 1)
        return tuple(accumulate(steps, lambda held, step: events.get(step, held), initial=value))[2:]

    @cached_property
    def _rows(self) -> _Rows:
        layout = self.manifest.layout
        words: dict[str, dict[int, Any]] = {topic: {} for topic in _WORDS}
        rows = _Rows([], [], {k: [] for k in sorted(layout.state)}, [], [], {k: [] for k in sorted(layout.obs)}, words)
        for topic, message in self._messages():
            if topic == "/action":
                self._in_order(topic, message.step, len(rows.action) + 1)
                rows.action.append(self._array(topic, message.values, (len(layout.action),), np.float64))
            elif topic == "/state":
                self._in_order(topic, message.step, len(rows.time) + 1 - self._skip)
                rows.time.append(message.time)
                for name, arrays in rows.state.items():
                    dtype = np.dtype(layout.dtype(name))
                    arrays.append(self._array(name, getattr(message, name, ()), layout.state[name], dtype))
            elif topic == "/collect":
                self._in_order(topic, message.step, len(rows.reward) + 1 - self._skip)
                rows.reward.append(message.reward)
                rows.status.append(message.status)
                for name, arrays in rows.obs.items():
                    values = getattr(message, m.OBS_PREFIX + name, ())
                    arrays.append(self._array(name, values, layout.obs[name].shape, np.dtype(layout.obs[name].dtype)))
            else:
                step, value = self._event(topic, message)
                words[topic][step] = value
        for topic, count, first in (
            ("/action", len(rows.action), 1),
            ("/state", len(rows.time), 1 - self._skip),
            ("/collect", len(rows.reward), 1 - self._skip),
        ):
            self._in_order(topic, self.manifest.steps + 1, count + first)
        return rows

    def _in_order(self, topic: str, step: int, expected: int) -> None:
        """Steps are complete, in order, and not more than the manifest says: that bounds the memory they take."""
        if step != expected or step > self.manifest.steps + 1:
            raise RecordError(
                f"{self._path} is inconsistent: {topic} goes from step {expected - 1} to {step}; "
                f"the manifest says {self.manifest.steps} steps"
            )

    def _array(self, name: str, values: Any, shape: tuple[int, ...], dtype: Any) -> Array:
        if isinstance(values, bytes):
            values = np.frombuffer(values, dtype)
        if len(values) != math.prod(shape):
            raise RecordError(
                f"{self._path} is inconsistent: {name} has {len(values)} numbers; the manifest says {shape}"
            )
        return np.array(values, dtype=dtype).reshape(shape)

    def _event(self, topic: str, message: Any) -> tuple[int, Any]:
        key, kind = _WORDS[topic], dict if topic == "/annotation" else str
        if isinstance(message, dict) and isinstance(message.get(key), kind):
            step = message.get("step")
            if isinstance(step, int) and 0 <= step <= self.manifest.steps:
                return step, message[key]
        raise RecordError(f"{self._path} is inconsistent: a message of {topic} is not of its schema")

    def _messages(self) -> Iterator[tuple[str, Any]]:
        """(topic, decoded message) of the topics that a reader looks at."""
        from google.protobuf.message import DecodeError
        from mcap.exceptions import McapError
        from mcap.records import Channel, Message, Metadata, Schema
        from mcap_protobuf.decoder import DecoderFactory

        self._facts: dict[str, Mapping[str, str]] = {}
        self._untimely: list[str] = []
        factory = DecoderFactory()
        schemas: dict[int, Any] = {}
        channels: dict[int, tuple[str, Any]] = {}
        for record in records(self._path):
            try:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    schema = schemas.get(record.schema_id)
                    if record.topic in _WORDS:
                        channels[record.id] = record.topic, json.loads
                    elif record.topic in _SCHEMAS:
                        decoder = factory.decoder_for(record.message_encoding, schema)
                        if decoder is None or schema is None or schema.name != _SCHEMAS[record.topic]:
                            raise ValueError(f"{record.topic} is not of the schema {_SCHEMAS[record.topic]}")
                        channels[record.id] = record.topic, decoder
                elif isinstance(record, Message) and record.channel_id in channels:
                    topic, decode = channels[record.channel_id]
                    message = decode(record.data)
                    stamp = record.sequence, float(record.log_time)
                    if topic in _SCHEMAS and stamp != (message.step, float(np.rint(message.time * 1e9))):
                        text = f"step {message.step} of {topic}, at {message.time} s, is logged at {record.log_time} ns"
                        self._untimely = self._untimely or [text]
                    yield topic, message
                elif isinstance(record, Metadata):
                    self._facts[record.name] = record.metadata
            except (McapError, DecodeError, ValueError, TypeError, KeyError, RecursionError) as error:
                raise RecordError(f"{self._path} is damaged: {error}") from error

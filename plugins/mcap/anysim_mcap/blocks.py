"""Columns to message records: frames whose messages have equal lengths become one matrix, a row for each frame.

A row is all that one frame says, /action, /state, /collect and /tf, each a complete MCAP record. What differs from row
to row lies at the same places in each, so a block is a template, repeated, and one assignment for each field. Lengths
change where a varint gets one byte more and with the status. Words come between: after the frame that they begin with.
"""

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.record.columns import Change, EpisodeColumns
from anysim.record.header import StateLayout
from anysim_mcap import messages as m
from anysim_mcap.mcap_file import Messages, one_message
from anysim_mcap.records import MESSAGE_HEAD, message_head
from anysim_mcap.wire import FIXED64, VARINT, block, block_head, tag, varints

SECOND = 1_000_000_000
"""[ns]"""
_KEY = MESSAGE_HEAD.size - 20
"""Where sequence and times begin in a message's head."""
_PARENT = "world"


class Channels(NamedTuple):
    """The numbers of a file's channels; `transforms` is None where they are not written."""

    action: int
    state: int
    collect: int
    annotation: int
    language: int
    transforms: int | None


class Lengths(NamedTuple):
    """What decides on the lengths of a frame's messages: an action or none, bytes of varints, and the status."""

    action: bool
    step: int
    seconds: int
    nanos: int
    status: str


class Hole(NamedTuple):
    """Bytes of a row that come from a column."""

    source: str
    at: int
    length: int


class Template(NamedTuple):
    """One row with its holes.

    Attributes:
        row: (L,) uint8.
        holes: those of one column each.
        stamps: (B, s) places of the bodies' time stamps.
        poses: (B * 56,) places of their numbers.
        ends, channels: (M,) of the messages in a row.
    """

    row: Array
    holes: list[Hole]
    stamps: Array
    poses: Array
    ends: Array
    channels: Array


class BlockEncoder:
    """Encodes the episodes of a run."""

    def __init__(self, layout: StateLayout, channels: Channels) -> None:
        self._layout, self._channels = layout, channels
        self._templates: dict[Lengths, Template] = {}

    def encode(self, columns: EpisodeColumns) -> Iterator[Messages]:
        """All messages of an episode, in order."""
        count = len(columns)
        steps = columns.first_step + np.arange(count, dtype=np.uint64)
        times = np.rint(columns.time * 1e9).astype(np.uint64)
        step, step_length = varints(steps)
        seconds, seconds_length = varints(times // SECOND, optional=True)
        nanos, nanos_length = varints(times % SECOND, optional=True)
        sources = self._sources(columns, steps, times) | {"step": step, "seconds": seconds, "nanos": nanos}
        lengths = np.stack([step_length, seconds_length, nanos_length])
        words = _by_row(columns)
        cuts = {0, count, *(change.row for change in columns.status)}
        cuts |= set((1 + np.flatnonzero((np.diff(lengths, axis=1) != 0).any(axis=0))).tolist())
        if columns.first_step == 0:
            cuts.add(1)
        status = iter([*columns.status, Change(count + 1, "")])
        said, following = "", next(status)
        edges = sorted(cuts)
        for begin, end in pairwise(edges):
            if begin == following.row:
                said, following = following.value, next(status)
            numbers: list[int] = lengths[:, begin].tolist()
            key = Lengths(columns.first_step + begin > 0, numbers[0], numbers[1], numbers[2], said)
            whole, done = self._block(key, sources, begin, end, times), 0
            for row in (row for row in words if begin <= row < end):
                yield _part(whole, done, row + 1 - begin, end - begin)
                done = row + 1 - begin
                for word in words[row]:
                    yield self._word(word, columns.first_step + row, int(times[row]))
            yield _part(whole, done, end - begin, end - begin)

    # ------------------------------------------------------------------ blocks

    def _sources(self, columns: EpisodeColumns, steps: Array, times: Array) -> dict[str, Array]:
        """The bytes (F, n) of every column."""
        keys = np.empty(len(columns), np.dtype([("sequence", "<u4"), ("log", "<u8"), ("publish", "<u8")]))
        keys["sequence"], keys["log"], keys["publish"] = steps, times, times
        arrays = {"key": keys, "time": columns.time, "reward": columns.reward, "action": columns.action}
        arrays |= {f"state.{name}": rows for name, rows in columns.state.items()}
        arrays |= {f"obs.{name}": rows for name, rows in columns.obs.items()}
        return {name: _row_bytes(rows) for name, rows in arrays.items()}

    def _block(self, key: Lengths, sources: Mapping[str, Array], begin: int, end: int, times: Array) -> Messages:
        template = self._templates.get(key)
        if template is None:
            template = self._templates[key] = self._template(key)
        count, length = end - begin, len(template.row)
        data = np.empty((count, length), np.uint8)
        data[:] = template.row
        for source, at, size in template.holes:
            data[:, at : at + size] = sources[source][begin:end, :size]
        if template.poses.size:
            data[:, template.poses] = sources["state.body_pose"][begin:end]
        if template.stamps.size:
            data[:, template.stamps] = _stamps(key, sources, begin, end)[:, None]
        ends = (np.arange(count) * length)[:, None] + template.ends
        return Messages(
            data.reshape(-1),
            ends.reshape(-1),
            np.tile(template.channels, count),
            np.repeat(times[begin:end], len(template.ends)),
        )

    def _word(self, word: tuple[str, object], step: int, time: int) -> Messages:
        kind, value = word
        channel = self._channels.annotation if kind == "annotations" else self._channels.language
        return one_message(channel, step, time, m.json_bytes({"step": step, kind: value}))

    # ------------------------------------------------------------------ templates

    def _template(self, key: Lengths) -> Template:
        layout, row = self._layout, _Row()
        if key.action:
            row.begin(self._channels.action)
            row.start(key.step)
            row.packed("action", m.FIRST_ARRAY, 8 * len(layout.action))
            row.end()
        row.begin(self._channels.state)
        row.start(key.step)
        for i, name in enumerate(sorted(layout.state)):
            size = np.dtype(layout.dtype(name)).itemsize * math.prod(layout.state[name])
            row.packed(f"state.{name}", m.FIRST_ARRAY + i, size)
        row.end()
        row.begin(self._channels.collect)
        row.start(key.step)
        row.add(m.REWARD)
        row.hole("reward", 8)
        row.add(block(4, key.status.encode()))
        for i, name in enumerate(sorted(layout.obs)):
            array = layout.obs[name]
            row.packed(f"obs.{name}", m.FIRST_ARRAY + i, np.dtype(array.dtype).itemsize * math.prod(array.shape))
        row.end()
        stamps: list[int] = []
        poses: list[int] = []
        if self._channels.transforms is not None:
            row.begin(self._channels.transforms)
            for body in layout.bodies:
                _add_transform(row, body, key, stamps, poses)
            row.end()
        return Template(
            np.frombuffer(bytes(row.data), np.uint8),
            row.holes,
            np.array(stamps, np.intp).reshape(len(layout.bodies) if stamps else 0, -1 if stamps else 0),
            np.array(poses, np.intp),
            np.array(row.ends),
            np.array(row.channels),
        )


class _Row:
    """A template in the making."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.holes: list[Hole] = []
        self.ends: list[int] = []
        self.channels: list[int] = []
        self._begin = 0

    def add(self, data: bytes) -> None:
        self.data += data

    def hole(self, source: str, length: int) -> None:
        if length:
            self.holes.append(Hole(source, len(self.data), length))
            self.data += bytes(length)

    def packed(self, source: str, number: int, length: int) -> None:
        """A field of packed numbers."""
        self.add(block_head(number, length))
        self.hole(source, length)

    def begin(self, channel: int) -> None:
        """Begin a message."""
        self._begin = len(self.data)
        self.channels.append(channel)
        self.holes.append(Hole("key", self._begin + _KEY, 20))
        self.data += bytes(MESSAGE_HEAD.size)

    def end(self) -> None:
        """End it: its head now knows its length."""
        head = message_head(self.channels[-1], len(self.data) - self._begin - MESSAGE_HEAD.size, 0, 0)
        self.data[self._begin : self._begin + len(head)] = head
        self.ends.append(len(self.data))

    def start(self, step_length: int) -> None:
        """The fields that the messages of one frame share."""
        self.add(m.STEP)
        self.hole("step", step_length)
        self.add(m.TIME)
        self.hole("time", 8)


def _add_transform(row: _Row, body: str, key: Lengths, stamps: list[int], poses: list[int]) -> None:
    """One foxglove.FrameTransform; notes where its stamp and its numbers are."""
    stamp = (1 + key.seconds if key.seconds else 0) + (1 + key.nanos if key.nanos else 0)
    start = block_head(1, stamp) + bytes(stamp) + block(2, _PARENT.encode()) + block(3, body.encode())
    vector = b"".join(tag(i, FIXED64) + bytes(8) for i in (1, 2, 3))
    quaternion = b"".join(tag(i, FIXED64) + bytes(8) for i in (1, 2, 3, 4))
    content = start + block(4, vector) + block(5, quaternion)
    row.add(block_head(1, len(content)))
    at = len(row.data)
    first = at + len(block_head(1, stamp))
    stamps += range(first, first + stamp)
    translation = at + len(start) + len(block_head(4, len(vector)))
    rotation = translation + len(vector) + len(block_head(5, len(quaternion)))
    for number in [translation + 9 * i + 1 for i in range(3)] + [rotation + 9 * i + 1 for i in range(4)]:
        poses += range(number, number + 8)
    row.add(content)


def _stamps(key: Lengths, sources: Mapping[str, Array], begin: int, end: int) -> Array:
    """google.protobuf.Timestamp (K, s) of the rows of a block."""
    parts: list[Array] = []
    for number, name, length in ((1, "seconds", key.seconds), (2, "nanos", key.nanos)):
        if length:
            head = np.full((end - begin, 1), tag(number, VARINT)[0], np.uint8)
            parts += [head, sources[name][begin:end, :length]]
    return np.concatenate(parts, axis=1)


def _row_bytes(rows: Array) -> Array:
    """An array (F, …) as bytes (F, n)."""
    if rows.size == 0:
        return np.empty((len(rows), 0), np.uint8)
    return np.ascontiguousarray(rows).reshape(len(rows), -1).view(np.uint8)


def _part(messages: Messages, begin: int, end: int, count: int) -> Messages:
    """The messages of some of the rows of a block of `count` equal ones."""
    size, each = len(messages.data) // count, len(messages.ends) // count
    chosen = slice(begin * each, end * each)
    return Messages(
        messages.data[begin * size : end * size],
        messages.ends[chosen] - begin * size,
        messages.channels[chosen],
        messages.times[chosen],
    )


def _by_row(columns: EpisodeColumns) -> dict[int, list[tuple[str, object]]]:
    """Annotations and words by the row with which they begin, in the order of rows."""
    found: dict[int, list[tuple[str, object]]] = {}
    for kind, changes in (("annotations", columns.annotations), ("text", columns.language)):
        for row, value in changes:
            found.setdefault(row, []).append((kind, value))
    return dict(sorted(found.items()))

"""Streams of a trajectory as files: one MCAP file for each family, a channel for each stream, written as rows come."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

import numpy as np

import anysim_mcap
from anysim.errors import RecordError
from anysim.record.columns import EpisodeColumns, where
from anysim.record.header import StreamInfo
from anysim.record.manifest import StreamEntry
from anysim.record.streams import StreamRow
from anysim.record.writer import StreamWriter, WrittenFile
from anysim_mcap.chunks import records
from anysim_mcap.mcap_file import McapFile, one_message
from anysim_mcap.messages import json_bytes
from anysim_mcap.stream_messages import Kind, fits, kind_of, nanoseconds

_OWN = ("action", "state", "observation", "collect", "trajectory")
"""First parts of the names of what every trajectory holds."""
_NAME = re.compile(r"[a-z][a-z0-9_]*(/[A-Za-z0-9_][A-Za-z0-9_.-]*)+")


class _Family:
    """The file of a family, with its channels."""

    def __init__(
        self, path: Path, streams: Mapping[str, StreamInfo], chunk: int, zstd: Callable[[bytes], bytes] | None
    ):
        self.name, self.streams, self.last = path.name, streams, 0
        self.kinds = {name: kind_of(name, info) for name, info in streams.items()}
        self.file: IO[bytes] = path.open("xb")
        try:
            self.mcap = McapFile(self.file, f"anysim-mcap {anysim_mcap.__version__}", chunk, zstd)
            schemas: dict[str, int] = {}
            self.channels: dict[str, int] = {}
            for name, kind in self.kinds.items():
                if kind.name not in schemas:
                    schemas[kind.name] = self.mcap.schema(kind.name, kind.encoding, kind.schema)
                self.channels[name] = self.mcap.channel(f"/{name}", schemas[kind.name], kind.message_encoding)
            for name, info in streams.items():
                said = info.model_dump(mode="json", exclude={"about"})
                facts = {
                    key: value if isinstance(value, str) else json_bytes(value).decode() for key, value in said.items()
                }
                about = json_bytes(info.about).decode()
                self.mcap.metadata("anysim/stream", {"topic": f"/{name}", **facts, "about": about})
        except BaseException:
            self.close()
            raise

    def append(self, row: StreamRow) -> None:
        if row.step < self.last:
            raise RecordError(
                f"the stream '{row.stream}' has a row of step {row.step} after one of step {self.last}; within a "
                "family steps don't go back"
            )
        self.last = row.step
        content = self.kinds[row.stream].encode(row, self.streams[row.stream])
        self.mcap.messages(one_message(self.channels[row.stream], row.step, nanoseconds(row.time), content))

    def close(self) -> None:
        with suppress(OSError):
            self.file.close()


class StreamFiles(StreamWriter):
    """`FAMILY.mcap` for each family of streams."""

    def __init__(
        self,
        directory: Path,
        columns: EpisodeColumns,
        streams: Mapping[str, StreamInfo],
        chunk: int,
        zstd: Callable[[bytes], bytes] | None,
    ) -> None:
        """`chunk` [bytes] and `zstd` are those of `McapFile`."""
        self._columns, self._streams, self._counts = columns, streams, dict.fromkeys(streams, 0)
        members: dict[str, dict[str, StreamInfo]] = {}
        for name, info in streams.items():
            family = name.partition("/")[0]
            if _NAME.fullmatch(name) is None or family in _OWN:
                raise RecordError(
                    f"a stream cannot be called '{name}': FAMILY/NAME… is expected, with a family that is not one of "
                    f"{', '.join(_OWN)}"
                )
            members.setdefault(family, {})[name] = info
        self._families: dict[str, _Family] = {}
        try:
            for family, found in members.items():
                self._families[family] = _Family(directory / f"{family}.mcap", found, chunk, zstd)
        except BaseException:
            self.abort()
            raise

    def append(self, rows: Sequence[StreamRow]) -> None:
        for row in rows:
            self._check(row)
            time = time_at(self._columns, row.step)
            self._families[row.stream.partition("/")[0]].append(row._replace(time=time))
            self._counts[row.stream] += 1

    def finish(self) -> tuple[WrittenFile, ...]:
        files: list[WrittenFile] = []
        for family in self._families.values():
            family.mcap.finish()
            family.file.close()
            files.append(WrittenFile(family.name, streams={name: self._counts[name] for name in family.streams}))
        return tuple(files)

    def abort(self) -> None:
        for family in self._families.values():
            family.close()

    def _check(self, row: StreamRow) -> None:
        """See that a row is of a stream and a step of the episode, and what its stream says."""
        info, columns = self._streams.get(row.stream), self._columns
        if info is None or not 0 <= row.step <= columns.steps:
            raise RecordError(
                f"{where(columns.header)}: a row of the stream '{row.stream}' at step {row.step}, of {columns.steps}; "
                "a stream that is declared and a step of the episode are expected"
            )
        if not fits(row.value, info):
            value, words = row.value, info.kind in ("text", "data")
            array = f"an array {np.shape(value)} of {getattr(value, 'dtype', type(value).__name__)}"
            found = type(value).__name__ if words else array
            expected = info.kind if words else f"an array {info.shape} of {info.dtype}"
            raise RecordError(
                f"{where(columns.header)}, step {row.step}: the stream '{row.stream}' has {found}; {expected} expected"
            )


def time_at(columns: EpisodeColumns, step: int) -> float:
    """Simulated time since the reset [s] after a control step."""
    return 0.0 if step < columns.first_step else float(columns.time[step - columns.first_step])


def read_rows(path: Path, streams: Mapping[str, StreamEntry], steps: int) -> Iterator[StreamRow]:
    """The rows of these streams of a family's file, in its order, `time` as they were logged [s].

    Raises:
        RecordError: the file is damaged, or holds what its streams do not say.
    """
    from google.protobuf.message import DecodeError
    from mcap.exceptions import McapError
    from mcap.records import Channel, Message, Schema

    wanted = {f"/{name}": (name, kind_of(name, info)) for name, info in streams.items()}
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, Kind]] = {}
    for record in records(path):
        try:
            if isinstance(record, Schema):
                schemas[record.id] = record.name
            elif isinstance(record, Channel) and record.topic in wanted:
                name, kind = wanted[record.topic]
                if schemas.get(record.schema_id) != kind.name:
                    raise ValueError(f"{record.topic} is not of the schema {kind.name}")
                channels[record.id] = name, kind
            elif isinstance(record, Message) and record.channel_id in channels:
                name, kind = channels[record.channel_id]
                if record.sequence > steps:
                    raise ValueError(f"{name} has a row of step {record.sequence}, of {steps}")
                value = kind.decode(record.data, streams[name])
                yield StreamRow(name, record.sequence, value, record.log_time / 1e9)
        except (McapError, DecodeError, ValueError, TypeError, KeyError, RecursionError) as error:
            raise RecordError(f"{path} is damaged: {error}") from error


def stream_faults(directory: Path, streams: Mapping[str, StreamEntry], times: np.ndarray) -> list[str]:
    """What is wrong with the streams of a trajectory whose times (steps + 1,) [s] these are, as sentences."""
    found: list[str] = []
    for file in sorted({entry.file for entry in streams.values()}):
        members = {name: entry for name, entry in streams.items() if entry.file == file}
        counts, last, path = dict.fromkeys(members, 0), 0, directory / file
        try:
            for row in read_rows(path, members, len(times) - 1):
                counts[row.stream] += 1
                expected = nanoseconds(float(times[row.step]))
                if row.step < last or nanoseconds(row.time) != expected:
                    found.append(f"{path}: step {row.step} of {row.stream} is logged at another time, or out of turn")
                    break
                last = row.step
            else:
                found += [
                    f"{path} has {count} rows of {name}; the manifest says {members[name].rows}"
                    for name, count in counts.items()
                    if count != members[name].rows
                ]
        except RecordError as error:
            found.append(str(error))
    return found

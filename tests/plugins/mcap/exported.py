"""Files of the exporter `foxglove` as MCAP's own reader decodes them, by the schemas that are in them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from mcap.reader import make_reader
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory


class Heard(NamedTuple):
    """A message: its log time [ns], control step, schema, content and bytes."""

    time: int
    step: int
    schema: str
    message: Any
    data: bytes


class _Json:
    """What MCAP's reader asks for channels in JSON."""

    def decoder_for(self, message_encoding: str, schema: Schema | None) -> Callable[[bytes], Any] | None:
        return json.loads if message_encoding == "json" else None


def heard(path: Path) -> dict[str, list[Heard]]:
    """All messages of a file by topic, in order; every one decoded, every checksum checked."""
    found: dict[str, list[Heard]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory(), _Json()])
        for schema, channel, message, content in reader.iter_decoded_messages():
            assert schema is not None
            rows = found.setdefault(channel.topic, [])
            rows.append(Heard(message.log_time, message.sequence, schema.name, content, message.data))
        summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    counts = {summary.channels[i].topic: n for i, n in summary.statistics.channel_message_counts.items()}
    assert counts == {topic: len(rows) for topic, rows in found.items()}
    return found


def frames(found: dict[str, list[Heard]]) -> set[str]:
    """The frames that transforms place, and the root of them all."""
    rows = [row for rows in found.values() for row in rows if row.schema == "foxglove.FrameTransforms"]
    placed = {t.child_frame_id: t.parent_frame_id for row in rows for t in row.message.transforms}
    assert set(placed.values()) <= placed.keys() | {"world"}
    return placed.keys() | {"world"}


def assert_consistent(found: dict[str, list[Heard]]) -> None:
    """Stamps are the log times but of readings that are late, and what is in a frame is in one that is placed."""
    known = frames(found)
    for topic, rows in found.items():
        assert [row.time for row in rows] == sorted(row.time for row in rows), topic
        for row in rows:
            stamp, frame = getattr(row.message, "timestamp", None), getattr(row.message, "frame_id", None)
            if stamp is not None:
                nanoseconds = stamp.seconds * 10**9 + stamp.nanos
                assert nanoseconds <= row.time if topic.startswith("/sensor/") else nanoseconds == row.time, topic
            if frame is not None and row.schema != "foxglove.Log" and not topic.endswith("/depth"):
                assert frame in known, topic
            for entity in getattr(row.message, "entities", ()):
                assert entity.frame_id in known

"""One MCAP file of messages from several places, merged by their times."""

from collections.abc import Iterable, Iterator
from functools import cache
from heapq import merge
from pathlib import Path
from typing import Any, NamedTuple

import anysim_mcap
from anysim.errors import RecordError
from anysim_mcap.chunks import records
from anysim_mcap.mcap_file import McapFile, one_message

CHUNK_SIZE = 1 << 20


class Topic(NamedTuple):
    """A channel: its name, its schema's name, encoding and content, and the encoding of its messages."""

    name: str
    schema: str
    schema_encoding: str
    content: bytes
    encoding: str = "protobuf"


class Entry(NamedTuple):
    """A message at a log time [ns] and a control step."""

    time: int
    step: int
    topic: Topic
    data: bytes


@cache
def protobuf_topic(name: str, message: Any) -> Topic:
    """The topic of a class of messages."""
    from mcap_protobuf.schema import build_file_descriptor_set

    content = build_file_descriptor_set(message).SerializeToString(deterministic=True)
    return Topic(name, message.DESCRIPTOR.full_name, "protobuf", content)


def write_merged(path: Path, about: Path, tracks: Iterable[Iterator[Entry]]) -> None:
    """Write messages of tracks, each in the order of time, and the metadata and attachments of the file `about`.

    Topics get their channels when they first say something; of equal times the earlier track comes first.
    """
    from zstandard import ZstdCompressor

    schemas: dict[tuple[str, bytes], int] = {}
    channels: dict[str, int] = {}
    with path.open("xb", buffering=CHUNK_SIZE) as file:
        zstd = ZstdCompressor(write_checksum=True).compress
        mcap = McapFile(file, f"anysim-mcap {anysim_mcap.__version__}", CHUNK_SIZE, zstd)
        _take_over(mcap, about)
        for entry in merge(*tracks, key=lambda entry: entry.time):
            topic = entry.topic
            if topic.name not in channels:
                key = topic.schema, topic.content
                if key not in schemas:
                    schemas[key] = mcap.schema(topic.schema, topic.schema_encoding, topic.content)
                channels[topic.name] = mcap.channel(f"/{topic.name}", schemas[key], topic.encoding)
            mcap.messages(one_message(channels[topic.name], entry.step, entry.time, entry.data))
        mcap.finish()


def recorded_messages(path: Path) -> Iterator[Entry]:
    """All messages of a recorded file.

    Raises:
        RecordError: it is damaged.
    """
    from mcap.records import Channel, Message, Schema

    schemas: dict[int, Any] = {}
    topics: dict[int, Topic] = {}
    for record in records(path):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            schema = schemas.get(record.schema_id)
            if schema is None:
                raise RecordError(f"{path} is damaged: {record.topic} has no schema")
            name = record.topic.removeprefix("/")
            topics[record.id] = Topic(name, schema.name, schema.encoding, schema.data, record.message_encoding)
        elif isinstance(record, Message):
            if record.channel_id not in topics:
                raise RecordError(f"{path} is damaged: a message is of no channel")
            yield Entry(record.log_time, record.sequence, topics[record.channel_id], record.data)


def _take_over(mcap: McapFile, about: Path) -> None:
    from mcap.records import Attachment, Metadata

    for record in records(about):
        if isinstance(record, Metadata):
            mcap.metadata(record.name, dict(record.metadata))
        elif isinstance(record, Attachment):
            mcap.attachment(record.name, record.media_type, record.data)

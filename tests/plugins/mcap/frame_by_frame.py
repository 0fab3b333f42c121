"""The same trajectory.mcap written slowly: frame by frame, field by field, by the writer of the package `mcap`."""

import struct
from pathlib import Path
from typing import Any
from unittest.mock import patch

import zstandard
from mcap.records import Chunk
from mcap.writer import CompressionType, Writer

import anysim_mcap
from anysim.record.columns import EpisodeColumns
from anysim.record.json import dump_json
from anysim_mcap import messages as m


def _without_second_checksum(**fields: Any) -> Chunk:
    return Chunk(**fields | ({"uncompressed_crc": 0} if fields["compression"] else {}))


def write_slowly(path: Path, columns: EpisodeColumns, status: str, options: Any) -> None:
    """Write an episode without cameras, with the options of the writer `mcap`."""
    # as anysim_mcap does; the package has no parameters for it
    fast = zstandard.ZstdCompressor(level=1, write_checksum=True).compress
    with (
        path.open("xb") as file,
        patch("mcap.writer.zstandard.compress", fast),
        patch("mcap.writer.Chunk", _without_second_checksum),
    ):
        compression = CompressionType.ZSTD if options.compression == "zstd" else CompressionType.NONE
        writer = Writer(file, options.chunk_size, compression, enable_crcs=True, enable_data_crcs=True)
        writer.start(library=f"anysim-mcap {anysim_mcap.__version__}")
        channels = _begin(writer, columns, options.transforms)

        def say(topic: str, time: int, step: int, data: bytes) -> None:
            writer.add_message(channels[topic], time, data, time, step)

        if columns.header.episode.instruction:
            say("/language", 0, 0, m.json_bytes({"step": 0, "text": columns.header.episode.instruction}))
        words, annotations, language = dict(columns.status), dict(columns.annotations), dict(columns.language)
        now = ""
        for row in range(len(columns)):
            step, seconds = columns.first_step + row, float(columns.time[row])
            time = round(seconds * 1e9)
            now = words.get(row, now)
            start = _varint(1 << 3) + _varint(step) + _double(2, seconds)
            if step > 0:
                say("/action", time, step, start + _block(10, columns.action[row].tobytes()))
            state = [_block(10 + i, columns.state[name][row].tobytes()) for i, name in enumerate(sorted(columns.state))]
            say("/state", time, step, start + b"".join(state))
            obs = [_block(10 + i, columns.obs[name][row].tobytes()) for i, name in enumerate(sorted(columns.obs))]
            reward = _double(3, float(columns.reward[row])) + _block(4, now.encode())
            say("/collect", time, step, start + reward + b"".join(obs))
            if "/tf" in channels:
                bodies = columns.header.run.layout.bodies
                poses = columns.state["body_pose"][row].tolist()
                say("/tf", time, step, b"".join(map(_transform, bodies, poses, [time] * len(bodies))))
            if row in annotations:
                say("/annotation", time, step, m.json_bytes({"step": step, "annotations": annotations[row]}))
            if row in language:
                say("/language", time, step, m.json_bytes({"step": step, "text": language[row]}))
        writer.add_metadata("anysim/outcome", {"status": status, "steps": str(columns.steps)})
        writer.finish()


def _begin(writer: Writer, columns: EpisodeColumns, transforms: bool) -> dict[str, int]:
    """What is said once. Returns the channels by topic."""
    run, episode = columns.header
    layout = run.layout
    facts = {
        "task": run.task, "seed": run.seed, "env": episode.env, "episode": episode.episode,
        "episode_seed": episode.episode_seed, "engine": run.engine, "engine_version": run.engine_version,
        "world_hash": run.world_hash, "control_dt": run.control_dt, "instruction": episode.instruction,
    }  # fmt: skip
    writer.add_metadata("anysim/trajectory", {key: str(value) for key, value in facts.items()})
    names = {"bodies": layout.bodies, "joints": layout.joints, "actuators": layout.actuators, "action": layout.action}
    writer.add_metadata("anysim/names", {key: m.json_bytes(value).decode() for key, value in names.items()})
    writer.add_attachment(0, 0, "spec.json", "application/json", dump_json(run.spec, "spec"))
    channels: dict[str, int] = {}
    for topic, name in (("/action", m.ACTION), ("/state", m.STATE), ("/collect", m.COLLECT)):
        schema = writer.register_schema(name, "protobuf", m.file_descriptor_set(name, layout))
        channels[topic] = writer.register_channel(topic, "protobuf", schema)
    for topic, schema in (("/annotation", m.ANNOTATION_SCHEMA), ("/language", m.LANGUAGE_SCHEMA)):
        number = writer.register_schema(schema["title"], "jsonschema", m.json_bytes(schema))
        channels[topic] = writer.register_channel(topic, "json", number)
    frames = writer.register_schema(m.TRANSFORMS, "protobuf", m.schemas(layout)[m.TRANSFORMS])
    if transforms and "body_pose" in layout.state:
        channels["/tf"] = writer.register_channel("/tf", "protobuf", frames)
    return channels


def _transform(body: str, pose: list[float], time: int) -> bytes:
    """One of the transforms of foxglove.FrameTransforms."""
    seconds, nanos = divmod(time, 10**9)
    stamp = (_varint(1 << 3) + _varint(seconds) if seconds else b"") + (
        _varint(2 << 3) + _varint(nanos) if nanos else b""
    )
    translation = b"".join(_double(i, x) for i, x in enumerate(pose[:3], 1))
    rotation = b"".join(_double(i, x) for i, x in enumerate(pose[3:], 1))
    names = _block(2, b"world") + _block(3, body.encode())
    return _block(1, _block(1, stamp) + names + _block(4, translation) + _block(5, rotation))


def _varint(value: int) -> bytes:
    out = b""
    while value > 0x7F:
        out += bytes([value & 0x7F | 0x80])
        value >>= 7
    return out + bytes([value])


def _double(number: int, value: float) -> bytes:
    return _varint(number << 3 | 1) + struct.pack("<d", value)


def _block(number: int, data: bytes) -> bytes:
    return _varint(number << 3 | 2) + _varint(len(data)) + data

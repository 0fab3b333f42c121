"""The writer `mcap`: trajectory.mcap with all numbers and words, an MP4 a camera, an MCAP file a family of streams."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, ValidationError

import anysim_mcap
from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.columns import EpisodeColumns
from anysim.record.header import CameraInfo, Header, RunHeader, StreamInfo
from anysim.record.json import dump_json
from anysim.record.writer import ImageWriter, StreamWriter, TrajectoryWriter, WrittenFile
from anysim_mcap import messages as m
from anysim_mcap.blocks import BlockEncoder, Channels
from anysim_mcap.mcap_file import McapFile, one_message
from anysim_mcap.streams import StreamFiles
from anysim_mcap.video import VideoWriter, frame_rate
from anysim_schemas.base import Spec

TRAJECTORY_FILE = "trajectory.mcap"
SPEC_ATTACHMENT = "spec.json"
WRITE_BUFFER = 1 << 20
"""Bytes that go into the file at once; most trajectories are smaller."""


class Options(Spec):
    """`record.options` of the writer `mcap`."""

    crf: Annotated[int, Field(ge=0, le=51, description="quality of the videos; less is better, 0 is without loss")] = 23
    preset: Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow"] = "veryfast"
    compression: Literal["zstd", "none"] = "zstd"
    chunk_size: Annotated[int, Field(ge=1024, le=16 << 20, description="of the MCAP file [bytes]")] = 256 << 10
    transforms: bool = Field(default=True, description="also write the bodies' poses as foxglove.FrameTransforms")


class McapWriter(TrajectoryWriter):
    """Writes trajectories. Log times are simulated time [ns]; nothing in the files depends on when or where."""

    name: ClassVar[str] = "mcap"

    def __init__(self, **options: Any) -> None:
        """Options are those of `Options`.

        Raises:
            RecordError: an option is unknown or out of range.
        """
        try:
            self.options = Options.model_validate(options)
        except ValidationError as error:
            raise RecordError(f"options of the writer mcap: {error}") from error

    @classmethod
    def options_model(cls) -> type[Options]:
        return Options

    def prepare(self, run: RunHeader) -> None:
        self._run = run
        self._spec = dump_json(run.spec, "spec")
        self._schemas = m.schemas(run.layout)
        self._encoder: BlockEncoder | None = None
        self._zstd: Callable[[bytes], bytes] | None = None
        if self.options.compression == "zstd":
            from zstandard import ZstdCompressor

            # one for all chunks: its tables are made once. Level 1: two thirds of level 3's time, 1 % more bytes
            self._zstd = ZstdCompressor(level=1, write_checksum=True).compress

    def write(self, directory: Path, columns: EpisodeColumns, status: str) -> tuple[WrittenFile, ...]:
        with (directory / TRAJECTORY_FILE).open("xb", buffering=WRITE_BUFFER) as file:
            mcap = McapFile(file, f"anysim-mcap {anysim_mcap.__version__}", self.options.chunk_size, self._zstd)
            self._describe(mcap, columns.header)
            channels = self._register(mcap, columns.header)
            if self._encoder is None:
                self._encoder = BlockEncoder(self._run.layout, channels)
            for block in self._encoder.encode(columns):
                mcap.messages(block)
            mcap.metadata("anysim/outcome", {"status": status, "steps": str(columns.steps)})
            mcap.finish()
        return (WrittenFile(TRAJECTORY_FILE),)

    def open_images(self, directory: Path, header: Header) -> ImageWriter:
        return VideoFiles(directory, header, self.options)

    def open_streams(self, directory: Path, columns: EpisodeColumns, streams: Mapping[str, StreamInfo]) -> StreamWriter:
        return StreamFiles(directory, columns, streams, self.options.chunk_size, self._zstd)

    # ------------------------------------------------------------------ what is said once

    def _describe(self, mcap: McapFile, header: Header) -> None:
        """What makes the file understandable by itself: metadata records, and the resolved spec as an attachment."""
        run, episode = header
        facts = {
            "task": run.task, "seed": run.seed, "env": episode.env, "episode": episode.episode,
            "episode_seed": episode.episode_seed, "engine": run.engine, "engine_version": run.engine_version,
            "world_hash": run.world_hash, "control_dt": run.control_dt, "instruction": episode.instruction,
        }  # fmt: skip
        mcap.metadata("anysim/trajectory", {key: str(value) for key, value in facts.items()})
        names = {"bodies": run.layout.bodies, "joints": run.layout.joints, "actuators": run.layout.actuators}
        names["action"] = run.layout.action
        mcap.metadata("anysim/names", {key: m.json_bytes(value).decode() for key, value in names.items()})
        mcap.attachment(SPEC_ATTACHMENT, "application/json", self._spec)

    def _register(self, mcap: McapFile, header: Header) -> Channels:
        """Schemas, channels, and what holds from the beginning."""
        layout, episode, schemas = header.run.layout, header.episode, self._schemas
        action, state, collect = (
            mcap.channel(topic, mcap.schema(name, "protobuf", schemas[name]))
            for topic, name in (("/action", m.ACTION), ("/state", m.STATE), ("/collect", m.COLLECT))
        )
        annotation, language = (
            mcap.channel(topic, mcap.schema(schema["title"], "jsonschema", m.json_bytes(schema)), "json")
            for topic, schema in (("/annotation", m.ANNOTATION_SCHEMA), ("/language", m.LANGUAGE_SCHEMA))
        )
        frames = mcap.schema(m.TRANSFORMS, "protobuf", schemas[m.TRANSFORMS])
        transforms = None
        if self.options.transforms and layout.state.get("body_pose") == (len(layout.bodies), 7):
            transforms = mcap.channel("/tf", frames)
        if episode.instruction:
            mcap.messages(one_message(language, 0, 0, m.json_bytes({"step": 0, "text": episode.instruction})))
        if episode.cameras:
            calibration = mcap.schema(m.CALIBRATION, "protobuf", schemas[m.CALIBRATION])
            placed = m.static_transforms(episode.cameras).SerializeToString(deterministic=True)
            mcap.messages(one_message(mcap.channel("/tf_static", frames), 0, 0, placed))
            for name, camera in sorted(episode.cameras.items()):
                data = m.calibration(name, camera).SerializeToString(deterministic=True)
                mcap.messages(one_message(mcap.channel(f"/camera/{name}/calibration", calibration), 0, 0, data))
        return Channels(action, state, collect, annotation, language, transforms)


class VideoFiles(ImageWriter):
    """One MP4 for each camera that takes an image; one that takes none makes no file."""

    def __init__(self, directory: Path, header: Header, options: Options) -> None:
        self._videos: dict[str, VideoWriter] = {}
        self._directory, self._header, self._options = directory, header, options

    def append(self, images: Mapping[str, Array]) -> None:
        for name, image in images.items():
            if name not in self._videos:
                self._videos[name] = self._begun(name, self._header.episode.cameras[name])
            self._videos[name].write(image)

    def finish(self) -> tuple[WrittenFile, ...]:
        files: list[WrittenFile] = []
        while self._videos:
            name, video = next(iter(self._videos.items()))
            video.close()
            del self._videos[name]
            files.append(WrittenFile(_file(name), name, video.frames))
        return tuple(files)

    def abort(self) -> None:
        while self._videos:
            self._videos.popitem()[1].abort()

    def _begun(self, name: str, camera: CameraInfo) -> VideoWriter:
        rate = frame_rate(self._header.run.control_dt, camera.every)
        path, options = self._directory / _file(name), self._options
        return VideoWriter(path, camera.width, camera.height, rate, options.crf, options.preset)


def _file(camera: str) -> str:
    return f"{camera}.mp4"

"""The writer `mcap`: trajectory.mcap with all numbers and words, and one MP4 per camera."""

from contextlib import suppress
from pathlib import Path
from typing import IO, Annotated, Any, ClassVar, Literal

from pydantic import Field, ValidationError

import anysim_mcap
from anysim.errors import RecordError
from anysim.record.frame import Frame
from anysim.record.header import CameraInfo, Header
from anysim.record.json import dump_json, plain
from anysim.record.writer import TrajectoryWriter, WrittenFile
from anysim_mcap import messages as m
from anysim_mcap.video import VideoWriter, frame_rate
from anysim_mcap.wire import TransformsEncoder
from anysim_schemas.base import Spec

TRAJECTORY_FILE = "trajectory.mcap"
SPEC_ATTACHMENT = "spec.json"


class Options(Spec):
    """`record.options` of the writer `mcap`."""

    crf: Annotated[int, Field(ge=0, le=51, description="quality of the videos; less is better, 0 is without loss")] = 23
    preset: Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow"] = "veryfast"
    compression: Literal["zstd", "none"] = "zstd"
    chunk_size: Annotated[int, Field(ge=1024, le=16 << 20, description="of the MCAP file [bytes]")] = 256 << 10
    transforms: bool = Field(default=True, description="also write the bodies' poses as foxglove.FrameTransforms")


class McapWriter(TrajectoryWriter):
    """Writes one trajectory. Log times are simulated time [ns]; nothing in the files depends on when or where."""

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
        self._file: IO[bytes] | None = None
        self._videos: dict[str, VideoWriter] = {}
        self._annotations: dict[str, Any] = {}
        self._language = ""
        self._log_time = 0
        self._steps = 0

    @classmethod
    def options_model(cls) -> type[Options]:
        return Options

    # ------------------------------------------------------------------ lifecycle

    def begin(self, directory: Path, header: Header) -> None:
        from mcap.writer import CompressionType, Writer

        self._file = (directory / TRAJECTORY_FILE).open("xb")
        self._mcap = Writer(
            self._file,
            chunk_size=self.options.chunk_size,
            compression=CompressionType.ZSTD if self.options.compression == "zstd" else CompressionType.NONE,
            enable_crcs=True,
            enable_data_crcs=True,
        )
        self._mcap.start(library=f"anysim-mcap {anysim_mcap.__version__}")
        self._describe(header)
        self._register(header)
        self._directory, self._header = directory, header

    def append(self, frame: Frame) -> None:
        time = self._log_time = round(frame.time * 1e9)
        encoder = self._encoder
        start = encoder.start(frame.step, frame.time)
        if frame.action is not None:
            self._write(self._action, encoder.action(start, frame.action), frame.step)
            self._steps = frame.step
        self._write(self._state, encoder.state(start, frame.state), frame.step)
        self._write(self._collect, encoder.collect(start, frame.reward, frame.status, frame.obs), frame.step)
        if self._transforms is not None:
            self._write(self._tf, self._transforms.encode(time, frame.state["body_pose"]), frame.step)
        annotations = plain(frame.annotations, "annotations")
        if annotations != self._annotations:
            self._annotations = annotations
            content = {"step": frame.step, "annotations": self._annotations}
            self._write(self._annotation, m.json_bytes(content), frame.step)
        if frame.language and frame.language != self._language:
            self._say(frame.language, frame.step)
        for name, image in frame.images.items():
            if name not in self._videos:  # a camera that takes no image makes no file, and another may write it
                path, camera = self._directory / self.video_file(name), self._header.episode.cameras[name]
                self._videos[name] = self.open_video(path, camera, self._header.run.control_dt)
            self._videos[name].write(image)

    def finish(self, status: str) -> tuple[WrittenFile, ...]:
        assert self._file is not None
        self._mcap.add_metadata("anysim/outcome", {"status": status, "steps": str(self._steps)})
        self._mcap.finish()
        self._file.close()
        self._file = None
        files = [WrittenFile(TRAJECTORY_FILE)]
        while self._videos:
            name, video = next(iter(self._videos.items()))
            video.close()
            del self._videos[name]
            files.append(WrittenFile(self.video_file(name), name, video.frames))
        return tuple(files)

    def abort(self) -> None:
        if self._file is not None:
            file, self._file = self._file, None
            with suppress(OSError):  # closing flushes, which fails again on a full disk, but frees the descriptor
                file.close()
        while self._videos:
            self._videos.popitem()[1].abort()

    # ------------------------------------------------------------------ videos by themselves

    def video_file(self, camera: str) -> str:
        return f"{camera}.mp4"

    def open_video(self, path: Path, camera: CameraInfo, control_dt: float) -> VideoWriter:
        rate = frame_rate(control_dt, camera.every)
        return VideoWriter(path, camera.width, camera.height, rate, self.options.crf, self.options.preset)

    # ------------------------------------------------------------------ inside

    def _write(self, channel: int, data: bytes, step: int) -> None:
        self._mcap.add_message(channel, self._log_time, data, self._log_time, step)

    def _say(self, text: str, step: int) -> None:
        self._language = text
        self._write(self._words, m.json_bytes({"step": step, "text": text}), step)

    def _describe(self, header: Header) -> None:
        """What makes the file understandable by itself: a metadata record, and the resolved spec as an attachment."""
        run, episode = header
        facts = {
            "task": run.task, "seed": run.seed, "env": episode.env, "episode": episode.episode,
            "episode_seed": episode.episode_seed, "engine": run.engine, "engine_version": run.engine_version,
            "world_hash": run.world_hash, "control_dt": run.control_dt, "instruction": episode.instruction,
        }  # fmt: skip
        self._mcap.add_metadata("anysim/trajectory", {key: str(value) for key, value in facts.items()})
        names = {"bodies": run.layout.bodies, "joints": run.layout.joints, "actuators": run.layout.actuators}
        names["action"] = run.layout.action
        self._mcap.add_metadata("anysim/names", {key: m.json_bytes(value).decode() for key, value in names.items()})
        self._mcap.add_attachment(0, 0, SPEC_ATTACHMENT, "application/json", dump_json(run.spec, "spec"))

    def _register(self, header: Header) -> None:
        """Schemas, channels, and what is said once."""
        from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
        from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
        from mcap_protobuf.schema import register_schema

        layout = header.run.layout
        self._encoder = m.FrameEncoder(layout)
        self._action, self._state, self._collect = (
            self._channel(topic, self._mcap.register_schema(name, "protobuf", m.file_descriptor_set(name, layout)))
            for topic, name in (("/action", m.ACTION), ("/state", m.STATE), ("/collect", m.COLLECT))
        )
        self._annotation, self._words = (
            self._channel(
                topic, self._mcap.register_schema(schema["title"], "jsonschema", m.json_bytes(schema)), "json"
            )
            for topic, schema in (("/annotation", m.ANNOTATION_SCHEMA), ("/language", m.LANGUAGE_SCHEMA))
        )
        transforms = register_schema(self._mcap, FrameTransforms)
        self._transforms = None
        if self.options.transforms and layout.state.get("body_pose") == (len(layout.bodies), 7):
            self._transforms = TransformsEncoder("world", layout.bodies)
            self._tf = self._channel("/tf", transforms)
        if header.episode.instruction:
            self._say(header.episode.instruction, 0)
        cameras = header.episode.cameras
        if cameras:
            calibration = register_schema(self._mcap, CameraCalibration)
            placed = m.static_transforms(cameras).SerializeToString(deterministic=True)
            self._write(self._channel("/tf_static", transforms), placed, 0)
            for name, camera in sorted(cameras.items()):
                data = m.calibration(name, camera).SerializeToString(deterministic=True)
                self._write(self._channel(f"/camera/{name}/calibration", calibration), data, 0)

    def _channel(self, topic: str, schema: int, encoding: str = "protobuf") -> int:
        return self._mcap.register_channel(topic, encoding, schema)

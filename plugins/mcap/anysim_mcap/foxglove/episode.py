"""Tracks of messages that are worked out of an episode, beside those of its recording."""

from collections.abc import Iterator, Sequence, Set
from typing import Any

import numpy as np

from anysim.record.film import camera_of
from anysim.record.header import StreamInfo
from anysim.record.reader import TrajectoryReader
from anysim.record.streams import StreamRow
from anysim.task.env import TaskEnv
from anysim_export.api import Episode
from anysim_mcap import messages as m
from anysim_mcap.foxglove.marks import has_marks, marks
from anysim_mcap.foxglove.merged import Entry, Topic, protobuf_topic
from anysim_mcap.foxglove.parts import stamp
from anysim_mcap.foxglove.scans import Rays, Scanner, readings, scan_message
from anysim_mcap.foxglove.scene import scene_update
from anysim_mcap.foxglove.video import h264
from anysim_mcap.stream_messages import kind_of, nanoseconds

Track = Iterator[Entry]


class EpisodeTracks:
    """The tracks of one episode."""

    def __init__(self, episode: Episode, reader: TrajectoryReader, env: TaskEnv, topics: Set[str]) -> None:
        """`env` has begun the episode; `topics` are those of the recording."""
        self._topics = topics
        self._episode, self._reader, self._env = episode, reader, env
        self._times = reader.times_from_reset

    def all(self, crf: int | None) -> list[Track]:
        """Every one of them; with the videos where their quality is given."""
        manifest = self._episode.manifest
        tracks = [self._scene(), self._cameras(), self._joints()]
        tracks += [self._words("instruction", self._episode.tasks), self._words("sub_task", self._episode.segments)]
        tracks += [self._video(name, crf) for name in manifest.cameras if crf is not None]
        tracks += [self._marks(name, info) for name, info in manifest.streams.items() if has_marks(info)]
        sensors = self._env.sensors
        for name in self._env.spec.world.sensors or {} if sensors is not None else {}:
            if f"sensor_{name}_time" in self._episode.states:
                tracks += [self._scans(name), self._depth(name)]
        return tracks

    def _entry(self, step: int, topic: Topic, data: bytes) -> Entry:
        return Entry(nanoseconds(self._times[step]), step, topic, data)

    def _scene(self) -> Track:
        from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

        update = scene_update(self._env.engine).SerializeToString(deterministic=True)
        yield self._entry(0, protobuf_topic("scene", SceneUpdate), update)

    def _cameras(self) -> Track:
        """Where the cameras are of which the recording does not say it, and their lenses."""
        from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
        from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

        names = [camera.name for camera in self._env.engine.world.cameras]
        others = [name for name in names if f"camera/{name}/calibration" not in self._topics]
        if not others:
            return
        infos = {name: camera_of(self._env, 0, name) for name in others}
        placed = m.static_transforms(infos).SerializeToString(deterministic=True)
        yield self._entry(0, protobuf_topic("tf_static", FrameTransforms), placed)
        for name, info in sorted(infos.items()):
            lens = m.calibration(name, info).SerializeToString(deterministic=True)
            yield self._entry(0, protobuf_topic(f"camera/{name}/calibration", CameraCalibration), lens)

    def _joints(self) -> Track:
        from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

        states, names = self._episode.states, self._episode.manifest.layout.joints
        kinds = {"joint_pos": "position", "joint_vel": "velocity", "joint_effort": "effort"}
        arrays = {kind: states[name].tolist() for name, kind in kinds.items() if name in states}
        topic = protobuf_topic("joint_states", JointStates)
        for step in range(self._episode.steps + 1) if names and arrays else ():
            message = JointStates(timestamp=stamp(nanoseconds(self._times[step])))
            for i, name in enumerate(names):
                message.joints.add(name=name, **{kind: rows[step][i] for kind, rows in arrays.items()})
            yield self._entry(step, topic, message.SerializeToString(deterministic=True))

    def _words(self, name: str, said: Sequence[str]) -> Track:
        """Words at the steps from which on they held."""
        info = StreamInfo(kind="text")
        for step, text in enumerate(said):
            if text and (step == 0 or text != said[step - 1]):
                yield self._row(StreamRow(name, step, text), info)

    def _row(self, row: StreamRow, info: StreamInfo) -> Entry:
        """A message as that of a stream of the recording."""
        kind = kind_of(row.stream, info)
        topic = Topic(row.stream, kind.name, kind.encoding, kind.schema, kind.message_encoding)
        return self._entry(row.step, topic, kind.encode(row._replace(time=float(self._times[row.step])), info))

    def _video(self, camera: str, crf: int | None) -> Track:
        from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

        topic = protobuf_topic(f"camera/{camera}", CompressedVideo)
        for step, unit in h264(self._reader.images(camera), crf or 0):
            time = stamp(nanoseconds(self._times[step]))
            message = CompressedVideo(timestamp=time, frame_id=m.camera_frame(camera), data=unit, format="h264")
            yield self._entry(step, topic, message.SerializeToString(deterministic=True))

    def _marks(self, name: str, info: StreamInfo) -> Track:
        from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations

        topic = protobuf_topic(f"{name}/marks", ImageAnnotations)
        for step, data in marks(self._reader.rows(name), info, self._times.tolist()):
            yield self._entry(step, topic, data)

    # ------------------------------------------------------------------ sensors

    def _readings(self, name: str) -> tuple[dict[str, Any], Iterator[tuple[int, int]]]:
        """All readings (T+1, …) of a sensor by field, and when each arrived, of which control step."""
        states, prefix = self._episode.states, f"sensor_{name}_"
        fields = {key.removeprefix(prefix): rows for key, rows in states.items() if key.startswith(prefix)}
        return fields, readings(fields["time"], fields["valid"], self._episode.manifest.control_dt)

    def _scans(self, name: str) -> Track:
        assert self._env.sensors is not None
        sensor, (fields, arrived) = self._env.sensors.sensor(name), self._readings(name)
        if not isinstance(sensor, Scanner) or "range" not in fields:
            return
        every, bodies = round(sensor.period / self._episode.manifest.control_dt), self._env.engine.world.bodies
        for step, read in arrived:
            found = sensor.rays(read // every)
            if found is None:
                return
            rays = Rays(*found)
            frame = bodies[rays.body].name if rays.body >= 0 else "world"
            reading = {key: rows[step] for key, rows in fields.items()}
            message = scan_message(rays, frame, reading, nanoseconds(self._times[read]))
            topic = protobuf_topic(f"sensor/{name}", type(message))
            yield self._entry(step, topic, message.SerializeToString(deterministic=True))

    def _depth(self, name: str) -> Track:
        fields, arrived = self._readings(name)
        depth = fields.get("depth")
        if depth is None or depth.ndim != 3 or depth.dtype != np.float32:
            return
        info = StreamInfo(kind="image", shape=depth.shape[1:], dtype="float32", unit="m", frame=f"sensor/{name}")
        for step, _ in arrived:
            yield self._row(StreamRow(f"sensor/{name}/depth", step, depth[step]), info)

"""The messages of a trajectory: their schemas, built at run time from the layout, and what is said once.

| topic | schema | content |
|---|---|---|
| /action | anysim.Action | values: float64 |
| /state | anysim.State | one repeated field per state array, of its number type, flattened in row-major order; \
  `bytes` where a number has one byte |
| /collect | anysim.Collect | reward, status, and `obs_<group>` |
| /tf | foxglove.FrameTransforms | the bodies in the world |
| /tf_static | foxglove.FrameTransforms | the cameras' optical frames, once |
| /camera/<name>/calibration | foxglove.CameraCalibration | once |
| /annotation, /language | JSON with a JSON Schema | when they change |

Every message but foxglove's has `step`; the first three have `time` [s].
"""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from anysim.record.header import CameraInfo, StateLayout
from anysim_mcap.wire import FIXED64, VARINT, tag

FIRST_ARRAY = 10
"""Arrays have field numbers from here on, in the order of their sorted names."""

ACTION, STATE, COLLECT = "anysim.Action", "anysim.State", "anysim.Collect"
TRANSFORMS, CALIBRATION = "foxglove.FrameTransforms", "foxglove.CameraCalibration"
OBS_PREFIX = "obs_"
STEP, TIME, REWARD = tag(1, VARINT), tag(2, FIXED64), tag(3, FIXED64)
"""Keys of the fields that hold them."""

ANNOTATION_SCHEMA = {
    "title": "anysim.Annotation",
    "description": "What holds from this control step on.",
    "type": "object",
    "properties": {"step": {"type": "integer"}, "annotations": {"type": "object"}},
    "required": ["step", "annotations"],
}
LANGUAGE_SCHEMA = {
    "title": "anysim.Language",
    "description": "The instruction in force from this control step on.",
    "type": "object",
    "properties": {"step": {"type": "integer"}, "text": {"type": "string"}},
    "required": ["step", "text"],
}


def json_bytes(value: Any) -> bytes:
    """Compact JSON; mappings keep their order, which means something in a spec."""
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()


# ---------------------------------------------------------------------- schemas


def file_descriptor_set(name: str, layout: StateLayout) -> bytes:
    """The serialised FileDescriptorSet of one of the anysim messages."""
    from google.protobuf.descriptor_pb2 import FieldDescriptorProto as F, FileDescriptorProto, FileDescriptorSet

    one, many = F.LABEL_OPTIONAL, F.LABEL_REPEATED
    fields = [("step", 1, F.TYPE_UINT64, one), ("time", 2, F.TYPE_DOUBLE, one)]
    if name == ACTION:
        fields.append(("values", FIRST_ARRAY, F.TYPE_DOUBLE, many))
    elif name == STATE:
        kinds = {"float64": F.TYPE_DOUBLE, "float32": F.TYPE_FLOAT, "int32": F.TYPE_SFIXED32, "bool": F.TYPE_BOOL}
        for i, key in enumerate(sorted(layout.state)):
            kind = kinds.get(layout.dtype(key))
            fields.append((key, FIRST_ARRAY + i, F.TYPE_BYTES if kind is None else kind, one if kind is None else many))
    else:
        fields += [("reward", 3, F.TYPE_DOUBLE, one), ("status", 4, F.TYPE_STRING, one)]
        for i, key in enumerate(sorted(layout.obs)):
            kind = F.TYPE_DOUBLE if layout.obs[key].dtype == "float64" else F.TYPE_FLOAT
            fields.append((OBS_PREFIX + key, FIRST_ARRAY + i, kind, many))
    package, _, bare = name.rpartition(".")
    file = FileDescriptorProto(name=f"{package}/{bare}.proto", package=package, syntax="proto3")
    message = file.message_type.add(name=bare)
    for field, number, kind, label in fields:
        message.field.add(name=field, number=number, type=kind, label=label)
    return FileDescriptorSet(file=[file]).SerializeToString(deterministic=True)


def schemas(layout: StateLayout) -> dict[str, bytes]:
    """The serialised FileDescriptorSets of all protobuf messages, by name."""
    from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
    from mcap_protobuf.schema import build_file_descriptor_set

    own = {name: file_descriptor_set(name, layout) for name in (ACTION, STATE, COLLECT)}
    foxglove = {TRANSFORMS: FrameTransforms, CALIBRATION: CameraCalibration}
    return own | {name: build_file_descriptor_set(kind).SerializeToString() for name, kind in foxglove.items()}


# ---------------------------------------------------------------------- content


def camera_frame(name: str) -> str:
    """The id of a camera's optical frame."""
    return f"camera/{name}"


def intrinsics(camera: CameraInfo) -> list[float]:
    """The matrix K (3, 3) of a pinhole camera, row by row."""
    focal = 0.5 * camera.height / math.tan(math.radians(camera.fov) / 2)
    return [focal, 0.0, 0.5 * camera.width, 0.0, focal, 0.5 * camera.height, 0.0, 0.0, 1.0]


def calibration(name: str, camera: CameraInfo) -> Any:
    """foxglove.CameraCalibration of a pinhole camera without distortion, at time 0."""
    return lens(camera_frame(name), camera.width, camera.height, intrinsics(camera))


def lens(frame: str, width: int, height: int, k: Sequence[float]) -> Any:
    """The same by its matrix K."""
    from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
    from google.protobuf.timestamp_pb2 import Timestamp

    one = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    p = [*k[0:3], 0.0, *k[3:6], 0.0, *k[6:9], 0.0]
    return CameraCalibration(timestamp=Timestamp(), frame_id=frame, width=width, height=height, K=k, R=one, P=p)


def static_transforms(cameras: Mapping[str, CameraInfo]) -> Any:
    """foxglove.FrameTransforms of the cameras' optical frames in the bodies they ride on, at time 0."""
    return transforms({camera_frame(name): (one.parent, one.pose) for name, one in sorted(cameras.items())})


def transforms(frames: Mapping[str, tuple[str, Sequence[float]]]) -> Any:
    """foxglove.FrameTransforms of frames, each by its parent and its pose (7,) there, at time 0."""
    from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
    from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
    from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
    from google.protobuf.timestamp_pb2 import Timestamp

    return FrameTransforms(
        transforms=[
            FrameTransform(
                timestamp=Timestamp(),
                parent_frame_id=parent,
                child_frame_id=frame,
                translation=Vector3(**dict(zip("xyz", pose[:3], strict=True))),
                rotation=Quaternion(**dict(zip("xyzw", pose[3:], strict=True))),
            )
            for frame, (parent, pose) in frames.items()
        ]
    )

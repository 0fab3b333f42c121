"""Rows of streams as messages: Foxglove's schemas where they have one for it, the same value back from each.

| kind | schema | encoding |
|---|---|---|
| image | foxglove.RawImage | `32FC1`, `mono16`, `mono8` or `rgb8`, compressed with its chunk |
| points | foxglove.PointCloud | float32 x, y, z |
| array | anysim.Array | shape, number type and bytes |
| text | foxglove.Log | |
| data | JSON with a JSON Schema | |
| data, of which `about` says so | foxglove.CameraCalibration, foxglove.FrameTransforms | one camera's, at time 0 |
"""

import json
import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from anysim.errors import RecordError
from anysim.record.header import StreamInfo
from anysim.record.streams import StreamRow
from anysim_mcap import messages as m
from anysim_mcap.messages import json_bytes

ARRAY = "anysim.Array"
DATA_SCHEMA = {
    "title": "anysim.Data",
    "description": "What a stream says at this control step.",
    "type": "object",
    "properties": {"step": {"type": "integer"}, "data": {}},
    "required": ["step", "data"],
}
_ENCODINGS = {("float32", 2): "32FC1", ("uint16", 2): "mono16", ("uint8", 2): "mono8", ("uint8", 3): "rgb8"}


class Kind(NamedTuple):
    """A kind of messages: name, encoding and bytes of its schema, and how a message is written and read."""

    name: str
    encoding: str
    schema: bytes
    encode: Callable[[StreamRow, StreamInfo], bytes]
    decode: Callable[[bytes, StreamInfo], Any]

    @property
    def message_encoding(self) -> str:
        """That of its channels."""
        return "protobuf" if self.encoding == "protobuf" else "json"


def kind_of(name: str, info: StreamInfo) -> Kind:
    """The kind of messages of a stream.

    Raises:
        RecordError: it is an image of a number type that images do not have.
    """
    if info.kind == "image" and (info.dtype, len(info.shape)) not in _ENCODINGS:
        raise RecordError(
            f"the stream '{name}' cannot be images of {info.dtype} with {len(info.shape)} axes; float32, uint16 and "
            "uint8 (H, W) and uint8 (H, W, 3) can; make it of the kind array"
        )
    kinds = _kinds()
    return kinds.get(str(info.about.get("schema")), kinds["data"]) if info.kind == "data" else kinds[info.kind]


@cache
def _kinds() -> dict[str, Kind]:
    from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
    from foxglove_schemas_protobuf.Log_pb2 import Log
    from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
    from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
    from mcap_protobuf.schema import build_file_descriptor_set

    messages: dict[str, tuple[Any, Any, Any]] = {
        "image": (RawImage, _image, _read_image),
        "points": (PointCloud, _points, _read_points),
        "text": (Log, _text, _read_text),
        "array": (_array_message(), _array, _read_array),
        m.CALIBRATION: (CameraCalibration, _lens, _read_lens),
        m.TRANSFORMS: (FrameTransforms, _place, _read_place),
    }
    kinds = {"data": Kind(DATA_SCHEMA["title"], "jsonschema", json_bytes(DATA_SCHEMA), _data, _read_data)}
    for kind, (message, encode, decode) in messages.items():
        schema = build_file_descriptor_set(message).SerializeToString(deterministic=True)
        kinds[kind] = Kind(message.DESCRIPTOR.full_name, "protobuf", schema, encode, decode)
    return kinds


@cache
def _array_message() -> Any:
    """The class of anysim.Array, built at run time."""
    from google.protobuf import descriptor_pool, message_factory
    from google.protobuf.descriptor_pb2 import FieldDescriptorProto as F, FileDescriptorProto

    pool = descriptor_pool.Default()
    try:
        found = pool.FindMessageTypeByName(ARRAY)
    except KeyError:
        file = FileDescriptorProto(name="anysim/Array.proto", package="anysim", syntax="proto3")
        message = file.message_type.add(name="Array")
        kinds = {"step": F.TYPE_UINT64, "time": F.TYPE_DOUBLE, "shape": F.TYPE_UINT32, "dtype": F.TYPE_STRING}
        for number, (name, kind) in enumerate({**kinds, "data": F.TYPE_BYTES}.items(), 1):
            label = F.LABEL_REPEATED if name == "shape" else F.LABEL_OPTIONAL
            message.field.add(name=name, number=number, type=kind, label=label)
        pool.AddSerializedFile(file.SerializeToString())
        found = pool.FindMessageTypeByName(ARRAY)
    return message_factory.GetMessageClass(found)


def fits(value: Any, info: StreamInfo) -> bool:
    """Whether a value is what a stream says."""
    if info.kind in ("text", "data"):
        return isinstance(value, str) == (info.kind == "text")
    return isinstance(value, np.ndarray) and value.dtype == np.dtype(info.dtype) and _alike(value.shape, info)


def _alike(shape: tuple[int, ...], info: StreamInfo) -> bool:
    return len(shape) == len(info.shape) and all(
        said in (size, None) for size, said in zip(shape, info.shape, strict=True)
    )


def nanoseconds(time: float) -> int:
    """A log time."""
    return round(time * 1e9)


def _stamp(row: StreamRow) -> Any:
    from google.protobuf.timestamp_pb2 import Timestamp

    seconds, nanos = divmod(nanoseconds(row.time), 10**9)
    return Timestamp(seconds=seconds, nanos=nanos)


# ---------------------------------------------------------------------- kinds


def _image(row: StreamRow, info: StreamInfo) -> bytes:
    from foxglove_schemas_protobuf.RawImage_pb2 import RawImage

    value = np.ascontiguousarray(row.value)
    return RawImage(
        timestamp=_stamp(row),
        frame_id=info.frame,
        width=value.shape[1],
        height=value.shape[0],
        encoding=_ENCODINGS[info.dtype, value.ndim],
        step=value.strides[0],
        data=value.tobytes(),
    ).SerializeToString(deterministic=True)


def _read_image(data: bytes, info: StreamInfo) -> Any:
    from foxglove_schemas_protobuf.RawImage_pb2 import RawImage

    message = RawImage.FromString(data)
    shape = (message.height, message.width, 3)[: len(info.shape)]
    if message.encoding != _ENCODINGS[info.dtype, len(shape)]:
        raise ValueError(f"an image is encoded as {message.encoding}")
    return _shaped(message.data, shape, info)


def _points(row: StreamRow, info: StreamInfo) -> bytes:
    from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField as Element
    from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud

    fields = [Element(name=name, offset=4 * k, type=Element.FLOAT32) for k, name in enumerate("xyz")]
    return PointCloud(
        timestamp=_stamp(row), frame_id=info.frame, point_stride=12, fields=fields, data=row.value.tobytes()
    ).SerializeToString(deterministic=True)


def _read_points(data: bytes, info: StreamInfo) -> Any:
    from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud

    found = PointCloud.FromString(data).data
    return _shaped(found, (len(found) // 12, 3), info)


def _array(row: StreamRow, info: StreamInfo) -> bytes:
    value = np.ascontiguousarray(row.value)
    return (
        _array_message()(step=row.step, time=row.time, shape=value.shape, dtype=info.dtype, data=value.tobytes())
    ).SerializeToString(deterministic=True)


def _read_array(data: bytes, info: StreamInfo) -> Any:
    message = _array_message().FromString(data)
    if message.dtype != info.dtype:
        raise ValueError(f"an array is of {message.dtype}")
    return _shaped(message.data, tuple(message.shape), info)


def _text(row: StreamRow, info: StreamInfo) -> bytes:
    from foxglove_schemas_protobuf.Log_pb2 import Log

    del info
    log = Log(timestamp=_stamp(row), level=Log.INFO, message=row.value, name=row.stream)
    return log.SerializeToString(deterministic=True)


def _read_text(data: bytes, info: StreamInfo) -> Any:
    from foxglove_schemas_protobuf.Log_pb2 import Log

    del info
    return Log.FromString(data).message


def _data(row: StreamRow, info: StreamInfo) -> bytes:
    del info
    return json_bytes({"step": row.step, "data": row.value})


def _read_data(data: bytes, info: StreamInfo) -> Any:
    del info
    return json.loads(data)["data"]


def _lens(row: StreamRow, info: StreamInfo) -> bytes:
    return m.lens(info.frame, **row.value).SerializeToString(deterministic=True)


def _read_lens(data: bytes, info: StreamInfo) -> Any:
    from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration

    message = CameraCalibration.FromString(data)
    if message.frame_id != info.frame:
        raise ValueError(f"a lens is of {message.frame_id}")
    return {"width": message.width, "height": message.height, "k": list(message.K)}


def _place(row: StreamRow, info: StreamInfo) -> bytes:
    return m.transforms({info.frame: (row.value["parent"], row.value["pose"])}).SerializeToString(deterministic=True)


def _read_place(data: bytes, info: StreamInfo) -> Any:
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

    [one] = FrameTransforms.FromString(data).transforms
    if one.child_frame_id != info.frame:
        raise ValueError(f"a place is of {one.child_frame_id}")
    p, q = one.translation, one.rotation
    return {"parent": one.parent_frame_id, "pose": [p.x, p.y, p.z, q.x, q.y, q.z, q.w]}


def _shaped(data: bytes, shape: tuple[int, ...], info: StreamInfo) -> Any:
    dtype = np.dtype(info.dtype)
    if not _alike(shape, info) or len(data) != math.prod(shape) * dtype.itemsize:
        raise ValueError(f"{len(data)} bytes of {shape} are no {info.shape} of {info.dtype}")
    return np.frombuffer(data, dtype).reshape(shape).copy()

"""Faults of what a trajectory's file says once more for viewers: poses of bodies, places and lenses of cameras."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.header import CameraInfo, StateLayout
from anysim_mcap import messages as m
from anysim_mcap.chunks import records

Cameras = Mapping[str, CameraInfo]


def drawn_faults(path: Path, layout: StateLayout, poses: Array, times: Array, cameras: Cameras) -> list[str]:
    """Contradictions to recorded poses (steps + 1, B, 7), times (steps + 1,) [s] and cameras, as sentences.

    What is not there is no fault: transforms are an option, and a camera may have been filmed later. A row of NaN is a
    step that was not recorded.

    Raises:
        RecordError: a message does not decode.
    """
    from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
    from google.protobuf.message import DecodeError
    from mcap.records import Channel, Message

    lenses = {f"/camera/{name}/calibration": m.calibration(name, camera) for name, camera in cameras.items()}
    places = {one.child_frame_id: one for one in m.static_transforms(cameras).transforms}
    topics: dict[int, str] = {}
    steps = list[int]()
    for record in records(path):
        if isinstance(record, Channel):
            topics[record.id] = record.topic
        if not isinstance(record, Message):
            continue
        topic, step = topics.get(record.channel_id, ""), record.sequence
        try:
            if topic in lenses and CameraCalibration.FromString(record.data) != lenses[topic]:
                return [f"{path}: {topic} is not the lens of that camera in the manifest"]
            if topic == "/tf_static":
                for place in FrameTransforms.FromString(record.data).transforms:
                    if place != places.get(place.child_frame_id, place):
                        return [f"{path}: {place.child_frame_id} is not where the manifest has that camera"]
            if topic == "/tf":
                steps.append(step)
                message = FrameTransforms.FromString(record.data)
                if step >= len(poses) or not _same(message, layout.bodies, poses[step], times[step]):
                    return [f"{path}: the transforms of step {step} are not those of its state"]
        except DecodeError as error:
            raise RecordError(f"{path} is damaged: {topic}, step {step}: {error}") from error
    whole = np.flatnonzero(np.isfinite(poses).all(axis=(1, 2))).tolist()
    return [] if steps in ([], whole) else [f"{path}: {len(steps)} steps have transforms, {len(whole)} have states"]


def _same(message: Any, bodies: Sequence[str], poses: Array, time: float) -> bool:
    """Whether foxglove.FrameTransforms says where these bodies are, at this time [s]."""
    found = message.transforms
    if [one.child_frame_id for one in found] != list(bodies) or {one.parent_frame_id for one in found} - {"world"}:
        return False
    rows = [(p.x, p.y, p.z, q.x, q.y, q.z, q.w) for p, q in ((one.translation, one.rotation) for one in found)]
    stamps = {one.timestamp.seconds * 10**9 + one.timestamp.nanos for one in found}
    return np.array_equal(np.reshape(rows, (-1, 7)), poses) and stamps <= {round(time * 1e9)}

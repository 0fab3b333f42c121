"""Readings of LiDARs as foxglove.LaserScan, where all rays lie in the sensor's plane, or foxglove.PointCloud."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from anysim.conventions import Array
from anysim_mcap.foxglove.parts import pose, stamp

EXTRAS = ("intensity", "instance_id", "class_id")
"""Fields of a reading that points carry too."""


class Rays(NamedTuple):
    """The rays of a reading.

    Attributes:
        body: the one that carries the sensor, -1 for the world.
        pose: (7,) of the sensor in its frame.
        directions: (R, 3) unit, in the sensor's axes.
        far: what is farther is not measured [m].
    """

    body: int
    pose: Array
    directions: Array
    far: float


@runtime_checkable
class Scanner(Protocol):
    """A sensor whose field `range` (R,) holds distances along rays; `rays` is None where no one body carries it."""

    def rays(self, number: int) -> tuple[int, Array, Array, float] | None:
        """(body, pose, directions, far) of the `number`-th reading of an episode."""
        ...


def scan_message(rays: Rays, frame: str, reading: Mapping[str, Array], time: int) -> Any:
    """The message of a reading of a time [ns], by the fields of the sensor."""
    flat = bool((np.abs(rays.directions[:, 2]) < 1e-12).all()) and len(rays.directions) > 1
    if flat:
        angles = np.unwrap(np.arctan2(rays.directions[:, 1], rays.directions[:, 0]))
        steps = np.diff(angles)
        if np.abs(steps - steps[0]).max() < 1e-6:
            return _scan(rays, frame, reading, time, angles)
    return _cloud(rays, frame, reading, time)


def _scan(rays: Rays, frame: str, reading: Mapping[str, Array], time: int, angles: Array) -> Any:
    from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan

    ranges = reading["range"].astype(float)
    return LaserScan(
        timestamp=stamp(time),
        frame_id=frame,
        pose=pose(rays.pose),
        start_angle=float(angles[0]),
        end_angle=float(angles[-1]),
        ranges=np.where(ranges < rays.far, ranges, np.inf).tolist(),
        intensities=reading["intensity"].astype(float).tolist() if "intensity" in reading else [],
    )


def _cloud(rays: Rays, frame: str, reading: Mapping[str, Array], time: int) -> Any:
    from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField as Element
    from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud

    met = reading["range"] < rays.far
    points = (reading["range"][:, None] * rays.directions)[met]
    columns = {name: points[:, k] for k, name in enumerate("xyz")}
    columns |= {name: reading[name][met] for name in EXTRAS if name in reading}
    table = np.empty(len(points), [(name, "<i4" if name.endswith("_id") else "<f4") for name in columns])
    for name, values in columns.items():
        table[name] = values
    kinds = {name: Element.INT32 if name.endswith("_id") else Element.FLOAT32 for name in columns}
    return PointCloud(
        timestamp=stamp(time),
        frame_id=frame,
        pose=pose(rays.pose),
        point_stride=table.itemsize,
        fields=[Element(name=name, offset=4 * k, type=kind) for k, (name, kind) in enumerate(kinds.items())],
        data=table.tobytes(),
    )


def readings(times: Array, valid: Array, dt: float) -> Iterator[tuple[int, int]]:
    """(control step, the step that was read) of each reading that arrived; `times` (T+1,) [s], `valid` (T+1,)."""
    before = -1.0
    for step, (time, good) in enumerate(zip(times.tolist(), valid.tolist(), strict=True)):
        if good and time != before:
            yield step, round(time / dt)
        before = time

"""Small messages of Foxglove's that others are made of."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from anysim.conventions import Array


def stamp(time: int) -> Any:
    """google.protobuf.Timestamp of a time [ns]."""
    from google.protobuf.timestamp_pb2 import Timestamp

    seconds, nanos = divmod(time, 10**9)
    return Timestamp(seconds=seconds, nanos=nanos)


def vector(values: ArrayLike) -> Any:
    """foxglove.Vector3."""
    from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

    x, y, z = np.asarray(values, dtype=float).tolist()
    return Vector3(x=x, y=y, z=z)


def pose(values: Array) -> Any:
    """foxglove.Pose of [x, y, z, qx, qy, qz, qw]."""
    from foxglove_schemas_protobuf.Pose_pb2 import Pose
    from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion

    x, y, z, w = values[3:].tolist()
    return Pose(position=vector(values[:3]), orientation=Quaternion(x=x, y=y, z=z, w=w))


def color(rgba: ArrayLike) -> Any:
    """foxglove.Color of numbers from 0 to 1; without the fourth it is opaque."""
    from foxglove_schemas_protobuf.Color_pb2 import Color

    r, g, b, a = [*np.clip(np.asarray(rgba, dtype=float), 0.0, 1.0).tolist(), 1.0][:4]
    return Color(r=r, g=g, b=b, a=a)

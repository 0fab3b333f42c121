"""The conventions of anysim, in one place. `docs/conventions.md` is the page for readers.

- SI units, right-handed, z up; angles in radians. Quaternions are xyzw, unit length.
- Poses are rows `[x, y, z, qx, qy, qz, qw]`; twists are rows `[vx, vy, vz, wx, wy, wz]`.
- A body's linear velocity is the velocity of its frame origin (not of its centre of mass), its angular velocity is its
  rate; both in world axes.
- Batched arrays are C-contiguous, with a leading `num_envs` axis; engine state is float64.
- A camera's frame is optical: x right, y down, z forward.
- Friction of a pair: the larger of the two coefficients; where the surfaces differ in priority, the one of higher
  priority decides alone. Restitution of a pair: the larger of the two.
- The cells of a height field are cut into two triangles from their corner of lowest x and y to that of highest x and y.
- Bodies and joints are ordered depth first, children in source order.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
"""A numpy array; docstrings give shape and unit."""

IDENTITY_QUATERNION: Final = (0.0, 0.0, 0.0, 1.0)
GROUND: Final = "terrain"
"""The name of the ground as an entity."""

WORLD: Final = -1
"""The index that stands for the world where a body is expected."""


def xyzw_from_wxyz(quaternion: Array) -> Array:
    """Reorder the last axis, for engines that put the scalar first."""
    return np.concatenate([quaternion[..., 1:], quaternion[..., :1]], axis=-1)


def wxyz_from_xyzw(quaternion: Array) -> Array:
    """Reorder the last axis, for engines that put the scalar first."""
    return np.concatenate([quaternion[..., 3:], quaternion[..., :3]], axis=-1)

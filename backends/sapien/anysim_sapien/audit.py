"""Read-back from PhysX, for an audit against the World."""

from math import pi
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.model.world import Box, Capsule, Cylinder, MeshShape, Sphere, World
from anysim_sapien.hulls import volume
from anysim_sapien.scene import EnvScene


def joint_limits(scene: EnvScene) -> Array:
    """(J, 2) [rad, m], infinite where there is none, not a number for joints that are not there."""
    limits = np.full((len(scene.joints), 2), np.nan)
    for index in np.flatnonzero(scene.layout.joint_there):
        limits[index] = np.asarray(scene.joints[index].limit, dtype=float).reshape(2)
    return limits


def geom_volumes(world: World, scene: EnvScene) -> Array:
    """(G,) [m^3] of colliding geoms; 0 for others, for planes and for height fields."""
    pairs = zip(world.geoms, scene.shapes, strict=True)
    return np.array([_volume(geom.shape, shapes[0]) if shapes else 0.0 for geom, shapes in pairs])


def _volume(kind: Any, shape: Any) -> float:
    match kind:
        case Box():
            x, y, z = (float(v) for v in shape.half_size)
            return 8 * x * y * z
        case Sphere():
            return 4 / 3 * pi * float(shape.radius) ** 3
        case Cylinder():
            return 2 * pi * float(shape.radius) ** 2 * float(shape.half_length)
        case Capsule():
            radius = float(shape.radius)
            return 2 * pi * radius**2 * float(shape.half_length) + 4 / 3 * pi * radius**3
        case MeshShape(concave=False):
            return volume(shape)
        case _:
            return 0.0

"""Rounding of what enters a World, so that its hash does not depend on the last bits of a machine's arithmetic."""

from anysim.conventions import Array
from anysim.model.world import Quat, Vec3


def tidy(vector: Array) -> Vec3:
    """Three numbers rounded to 1e-12 (a picometre), without negative zeros."""
    x, y, z = (round(float(v), 12) + 0.0 for v in vector)
    return (x, y, z)


def split(pose: Array) -> tuple[Vec3, Quat]:
    """Position and quaternion of a pose (7,), rounded to 1e-12 and 1e-14."""
    x, y, z, w = (round(float(v), 14) + 0.0 for v in pose[3:])
    return tidy(pose[:3]), (x, y, z, w)

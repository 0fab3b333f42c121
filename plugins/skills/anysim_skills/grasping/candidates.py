"""Grasp candidates of a small thing from above: four turns of the hand about the vertical."""

import numpy as np

from anysim.conventions import Array

_YAWS = np.pi / 2 * np.arange(4)
TOP_DOWN = len(_YAWS)
"""How many candidates there are."""
DOWN = np.array([0.0, 0.0, -1.0])
"""The way the hand approaches in each of them."""


def from_above(object_pose: Array) -> Array:
    """Tool poses (n, 4, 7) at the origins of objects (n, 7), the tool's z down, its x along a horizontal face."""
    yaw = 2.0 * np.arctan2(object_pose[:, 5], object_pose[:, 6])
    half = 0.5 * (yaw[:, None] + _YAWS)
    poses = np.zeros((*half.shape, 7))
    poses[..., :3] = object_pose[:, None, :3]
    poses[..., 3], poses[..., 4] = np.cos(half), np.sin(half)
    return poses


def across(size: Array) -> Array:
    """(n, 4) [m] what the fingers have to span in each candidate, of objects of sizes (n, 3) [m] along their axes."""
    return size[:, [1, 0, 1, 0]]

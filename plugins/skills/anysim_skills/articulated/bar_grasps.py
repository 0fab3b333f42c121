"""Grasps of a bar that stands off a front: a gripper comes from the front, a hand with fingers from beside the bar."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P

_TILTS = np.deg2rad([0.0, 20.0, -20.0, 40.0, -40.0])


def _turns() -> Array:
    """Tool orientations in the handle's frame, whose x points away from the front and whose z lies along the bar.

    The tool's z points into the front and its x along the bar, either way, so that the fingers close across the bar.
    """
    turns: list[Array] = []
    for tilt in _TILTS:
        about_bar = P.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(tilt))
        for way in (1.0, -1.0):
            along, into = np.array([0.0, 0.0, way]), np.array([-1.0, 0.0, 0.0])
            turns.append(P.multiply(about_bar, P.from_matrix(np.stack([along, np.cross(into, along), into], axis=1))))
    return np.array(turns)


TURNS = _turns()


def hooks(tilts: Array) -> Array:
    """(G, 4) orientations of a hand in the handle's frame, whose fingers are behind the bar and point across it.

    The tool's z, out of the palm, points away from the front, and its y, along the fingers, to either side of the bar.
    Tilted about the bar by angles [rad].
    """
    turns: list[Array] = []
    for tilt in tilts:
        about_bar = P.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(tilt))
        for way in (1.0, -1.0):
            out, fingers = np.array([1.0, 0.0, 0.0]), np.array([0.0, way, 0.0])
            turns.append(P.multiply(about_bar, P.from_matrix(np.stack([np.cross(fingers, out), fingers, out], axis=1))))
    return np.array(turns)


def bar_grasps(handle: Array, turns: Array = TURNS) -> Array:
    """Tool poses (n, G, 7) at the middle of handles (n, 7), turned as `turns` (G, 4) in their frames."""
    count = len(turns)
    turned = P.multiply(
        np.repeat(handle[:, None, 3:], count, axis=1), np.broadcast_to(turns, (len(handle), *turns.shape))
    )
    return np.concatenate([np.repeat(handle[:, None, :3], count, axis=1), turned], axis=-1)

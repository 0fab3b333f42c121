"""Grasps of a bar that stands off a front: the hand comes from the front, turned about the bar by one of five tilts."""

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


def bar_grasps(handle: Array) -> Array:
    """Tool poses (n, 10, 7) at the middle of handles (n, 7), tool z towards the front; those without tilt first."""
    turns = P.multiply(
        np.repeat(handle[:, None, 3:], len(TURNS), axis=1), np.broadcast_to(TURNS, (len(handle), *TURNS.shape))
    )
    return np.concatenate([np.repeat(handle[:, None, :3], len(TURNS), axis=1), turns], axis=-1)

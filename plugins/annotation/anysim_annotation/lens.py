"""Pinhole projection: points of the world as pixels of a camera, without any engine.

Pixel coordinates are continuous: (0, 0) is the upper left corner of the image, the centre of the first pixel is at
(0.5, 0.5), and (W, H) is the lower right corner. Boxes, projected points and intrinsics share them.
"""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P


class Projected(NamedTuple):
    """Points in an image, whatever stands before them.

    Attributes:
        pixel: (..., 2) [px] column and row; NaN where the point is not in front of the camera.
        depth: (...) [m] along the optical axis.
        inside: (...) bool, in front of the camera and within the image.
    """

    pixel: Array
    depth: Array
    inside: Array


def focal_length(fov: Array, height: int) -> Array:
    """[px] of vertical fields of view [degrees]."""
    return height / (2 * np.tan(np.radians(fov) / 2))


def intrinsics(fov: float, width: int, height: int) -> Array:
    """(3, 3) [px] what takes a point of the optical frame to homogeneous pixel coordinates."""
    f = float(focal_length(np.asarray(fov), height))
    return np.array([[f, 0.0, width / 2], [0.0, f, height / 2], [0.0, 0.0, 1.0]])


def seen_from(pose: Array, points: Array) -> Array:
    """Points (E, ..., 3) [m] of the world in optical frames at poses (E, 7)."""
    frame = pose.reshape(len(pose), *(1,) * (points.ndim - 2), 7)
    shape = (*points.shape[:-1], 4)
    return P.rotate_inverse(np.broadcast_to(frame[..., 3:], shape), points - frame[..., :3])


def in_image(local: Array, fov: Array, width: int, height: int) -> Projected:
    """Points (E, ..., 3) [m] of optical frames as pixels of images with fields of view (E,) [degrees]."""
    depth = local[..., 2]
    f = focal_length(fov, height).reshape(len(fov), *(1,) * (local.ndim - 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        pixel = local[..., :2] / depth[..., None] * f + np.array([width / 2, height / 2])
    pixel = np.where((depth > 0)[..., None], pixel, np.nan)
    inside = (depth > 0) & ((pixel >= 0) & (pixel <= (width, height))).all(axis=-1)
    return Projected(pixel, depth, inside)


def project(points: Array, pose: Array, fov: Array, width: int, height: int) -> Projected:
    """Points (E, ..., 3) [m] of the world as pixels of cameras at poses (E, 7) with fields of view (E,) [degrees]."""
    return in_image(seen_from(pose, points), fov, width, height)

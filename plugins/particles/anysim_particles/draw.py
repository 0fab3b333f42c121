"""Drawing of matter into what an engine has drawn: balls and triangles, where they are nearer than what is there."""

from collections.abc import Mapping, Sequence

import numpy as np

from anysim.conventions import Array
from anysim.engine.cameras import CameraView
from anysim.math import pose as P

_NO_RGB, _NO_IDS = np.zeros((0, 0, 3), dtype=np.uint8), np.zeros((0, 0), dtype=np.int32)


def draw_spheres(
    points: Array,
    radius: float,
    color: Sequence[float],
    mark: int,
    view: CameraView,
    row: int,
    images: Mapping[str, Array],
) -> None:
    """Draw balls (P, 3) [m] of the world into row `row` of images by channel, which have `depth`.

    Args:
        points: their middles, world axes.
        radius: of all of them [m].
        color: red, green and blue, 0 to 1.
        mark: their id in `segmentation`.
        view: what the images are seen from.
        row: which of its envs it is.
        images: (E, H, W, …), changed.
    """
    from anysim_particles.kernels.spheres import spheres

    local, focal = _seen(points, view, row)
    spheres(
        local,
        radius,
        focal,
        float(view.near),
        float(view.far),
        255.0 * np.array(color, dtype=float),
        mark,
        *_channels(images, row),
    )


def draw_triangles(
    points: Array,
    faces: Array,
    color: Sequence[float],
    mark: int,
    view: CameraView,
    row: int,
    images: Mapping[str, Array],
) -> None:
    """Draw a surface of triangles (F, 3) through points (P, 3) [m] of the world; the rest as `draw_spheres` has it."""
    from anysim_particles.kernels.triangles import triangles

    local, focal = _seen(points, view, row)
    corners = local[faces]
    flat = P.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(local)
    np.add.at(normals, faces, flat[:, None])
    triangles(
        local,
        normals,
        np.ascontiguousarray(faces, dtype=np.int32),
        focal,
        float(view.near),
        float(view.far),
        255.0 * np.array(color, dtype=float),
        mark,
        *_channels(images, row),
    )


def _seen(points: Array, view: CameraView, row: int) -> tuple[Array, float]:
    """Points (P, 3) [m] in the optical frame of a camera in one of its envs, and its focal length [px]."""
    local = P.rotate_inverse(view.pose[row, 3:], points - view.pose[row, :3])
    return np.ascontiguousarray(local), float(view.height / (2.0 * np.tan(np.radians(view.fov[row]) / 2.0)))


def _channels(images: Mapping[str, Array], row: int) -> tuple[Array, Array, Array]:
    """Depth, rgb and segmentation of an env; of no rows where they are not asked for."""
    rgb = images["rgb"][row] if "rgb" in images else _NO_RGB
    return images["depth"][row], rgb, images["segmentation"][row] if "segmentation" in images else _NO_IDS

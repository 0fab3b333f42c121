"""Drawing of particles into what an engine has drawn: balls that hide, and are hidden by, what is farther or nearer."""

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

    depth = images["depth"][row]
    local = P.rotate_inverse(view.pose[row, 3:], points - view.pose[row, :3])
    focal = depth.shape[0] / (2.0 * np.tan(np.radians(view.fov[row]) / 2.0))
    spheres(
        np.ascontiguousarray(local),
        radius,
        float(focal),
        float(view.near),
        float(view.far),
        255.0 * np.array(color, dtype=float),
        mark,
        depth,
        images["rgb"][row] if "rgb" in images else _NO_RGB,
        images["segmentation"][row] if "segmentation" in images else _NO_IDS,
    )

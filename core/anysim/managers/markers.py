"""Markers of goals on images: a disc where a goal is, as large as a ball there would look, the same on every engine.

They are painted on what an engine has drawn, and nothing hides them: no engine has to know of them, no world changes.
"""

from collections.abc import Mapping

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.math import pose as P

RADIUS = 0.025
"""Of the ball that a marker stands for [m]."""

LEAST = 3.0
"""Radius of a marker that is far away [px]."""

COLORS = ((255, 0, 170), (0, 200, 255), (255, 190, 0), (120, 255, 60))
"""Of goals, in the order in which the task names them; few things look like that."""

_FILL, _RIM, _RIM_WIDTH = 0.35, 0.95, 1.5


def paint(
    images: Array, goals: Mapping[str, Array], engine: SimEngine, camera: str, ids: Array, body_pose: Array | None
) -> Array:
    """A copy of the images (E, H, W, 3) uint8 of a camera with the goals of the envs `ids` marked.

    Args:
        images: what the camera saw.
        goals: by name the world poses (N, 7) of all envs.
        engine: has the camera.
        camera: its name.
        ids: (E,) the envs.
        body_pose: (E, B, 7) where all bodies were, or None for where they are.
    """
    images = images.copy()
    if not goals:
        return images
    view = engine.camera_view(camera, ids, body_pose)
    focal = images.shape[1] / (2.0 * np.tan(np.radians(view.fov) / 2.0))
    for number, poses in enumerate(goals.values()):
        points = P.compose(P.inverse(view.pose), poses[ids])[:, :3]
        color = np.array(COLORS[number % len(COLORS)], dtype=float)
        for image, point, f in zip(images, points, focal, strict=True):
            _disc(image, point, float(f), color)
    return images


def _disc(image: Array, point: Array, focal: float, color: Array) -> None:
    """Blend a disc with a rim into an image (H, W, 3), for a ball at a point of the optical frame."""
    height, width = image.shape[:2]
    x, y, z = point
    if z <= RADIUS:
        return
    radius = max(LEAST, focal * RADIUS / z)
    middle = (width / 2 + focal * x / z - 0.5, height / 2 + focal * y / z - 0.5)  # of pixel 0 the middle is 0.5
    if not (-radius < middle[0] < width + radius and -radius < middle[1] < height + radius):
        return
    reach = radius + _RIM_WIDTH
    left, right = max(0, int(middle[0] - reach)), min(width, int(middle[0] + reach) + 2)
    top, bottom = max(0, int(middle[1] - reach)), min(height, int(middle[1] + reach) + 2)
    down, across = np.mgrid[top:bottom, left:right]
    away = np.sqrt((across - middle[0]) ** 2 + (down - middle[1]) ** 2)
    fill = _FILL * np.clip(radius - away + 0.5, 0.0, 1.0)
    rim = _RIM * np.clip(_RIM_WIDTH / 2 - np.abs(away - radius) + 0.5, 0.0, 1.0)
    share = np.maximum(fill, rim)[..., None]
    patch = image[top:bottom, left:right]
    patch[...] = np.rint(patch * (1.0 - share) + color * share)

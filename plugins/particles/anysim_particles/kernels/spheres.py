"""Balls drawn into images by depth, pixel by pixel, with a light over the camera's shoulder."""

import math

from anysim.conventions import Array
from anysim_particles.kernels.compiling import compiled

LIGHT = (-0.35, -0.65, -0.67)
"""Unit vector towards the light in the optical frame (x right, y down, z forward)."""
AMBIENT = 0.4


@compiled
def spheres(
    points: Array,
    radius: float,
    focal: float,
    near: float,
    far: float,
    tint: Array,
    mark: int,
    depth: Array,
    rgb: Array,
    segmentation: Array,
) -> None:
    """Draw balls where they are nearer than what is there.

    Args:
        points: (P, 3) [m] in the optical frame.
        radius: [m].
        focal: [px].
        near, far: [m] what is nearer or farther is not seen.
        tint: (3,) 0 to 255.
        mark: the segmentation id.
        depth: (H, W) float32 along the optical axis [m].
        rgb: (H, W, 3) uint8, or of no rows where it is not asked for.
        segmentation: (H, W) int32, or of no rows.
    """
    height, width = depth.shape
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if not (z - radius > near and z < far):
            continue
        u, v, size = width / 2 + focal * x / z, height / 2 + focal * y / z, focal * radius / (z - radius)
        # corners of a ball at the edge of a wide image reach further than its radius says
        size *= 1.0 + 0.5 * ((x / z) ** 2 + (y / z) ** 2)
        if not (u + size > 0.0 and u - size < width and v + size > 0.0 and v - size < height):
            continue
        left, right = max(0, int(u - size - 1)), min(width, int(u + size + 2))
        top, bottom = max(0, int(v - size - 1)), min(height, int(v + size + 2))
        square = x * x + y * y + z * z - radius * radius
        for row in range(top, bottom):
            b = (row + 0.5 - height / 2) / focal
            for column in range(left, right):
                a = (column + 0.5 - width / 2) / focal
                # the nearer root of |t (a, b, 1) - point| = radius, t being the depth
                m, q = a * x + b * y + z, a * a + b * b + 1.0
                root = m * m - q * square
                if root <= 0.0:
                    continue
                t = (m - math.sqrt(root)) / q
                if not near < t < depth[row, column]:
                    continue
                depth[row, column] = t
                if segmentation.shape[0] > 0:
                    segmentation[row, column] = mark
                if rgb.shape[0] > 0:
                    n = ((a * t - x) * LIGHT[0] + (b * t - y) * LIGHT[1] + (t - z) * LIGHT[2]) / radius
                    shade = AMBIENT + (1.0 - AMBIENT) * max(n, 0.0)
                    for c in range(3):
                        rgb[row, column, c] = int(min(255.0, tint[c] * shade + 0.5))

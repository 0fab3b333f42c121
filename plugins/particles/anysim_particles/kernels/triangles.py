"""Triangles drawn into images by depth, seen from both sides, with a light over the camera's shoulder."""

import math

from anysim.conventions import Array
from anysim_particles.kernels.compiling import compiled
from anysim_particles.kernels.spheres import AMBIENT, LIGHT


@compiled
def triangles(
    points: Array,
    normals: Array,
    faces: Array,
    focal: float,
    near: float,
    far: float,
    tint: Array,
    mark: int,
    depth: Array,
    rgb: Array,
    segmentation: Array,
) -> None:
    """Draw triangles where they are nearer than what is there; one that reaches behind the near plane is not drawn.

    Args:
        points: (P, 3) [m] in the optical frame.
        normals: (P, 3) of the surface at the points, of either sign.
        faces: (F, 3) indices of points.
        focal: [px].
        near, far: [m] what is nearer or farther is not seen.
        tint: (3,) 0 to 255.
        mark: the segmentation id.
        depth: (H, W) float32 along the optical axis [m].
        rgb: (H, W, 3) uint8, or of no rows where it is not asked for.
        segmentation: (H, W) int32, or of no rows.
    """
    height, width = depth.shape
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        if not (points[i, 2] > near and points[j, 2] > near and points[k, 2] > near):
            continue
        # one over the depth is linear in the image
        p, q, r = 1.0 / points[i, 2], 1.0 / points[j, 2], 1.0 / points[k, 2]
        ax, ay = width / 2 + focal * points[i, 0] * p, height / 2 + focal * points[i, 1] * p
        bx, by = width / 2 + focal * points[j, 0] * q, height / 2 + focal * points[j, 1] * q
        cx, cy = width / 2 + focal * points[k, 0] * r, height / 2 + focal * points[k, 1] * r
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        low, high = min(ax, bx, cx), max(ax, bx, cx)
        top, bottom = min(ay, by, cy), max(ay, by, cy)
        if area == 0.0 or not (high > 0.0 and low < width and bottom > 0.0 and top < height):
            continue
        for row in range(max(0, int(top - 0.5)), min(height, int(bottom + 1.5))):
            y = row + 0.5
            for column in range(max(0, int(low - 0.5)), min(width, int(high + 1.5))):
                x = column + 0.5
                u = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area
                v = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area
                w = 1.0 - u - v
                if u < 0.0 or v < 0.0 or w < 0.0:
                    continue
                t = 1.0 / (u * p + v * q + w * r)
                if not near < t < min(far, depth[row, column]):
                    continue
                depth[row, column] = t
                if segmentation.shape[0] > 0:
                    segmentation[row, column] = mark
                if rgb.shape[0] > 0:
                    nx = u * normals[i, 0] + v * normals[j, 0] + w * normals[k, 0]
                    ny = u * normals[i, 1] + v * normals[j, 1] + w * normals[k, 1]
                    nz = u * normals[i, 2] + v * normals[j, 2] + w * normals[k, 2]
                    size = math.sqrt(nx * nx + ny * ny + nz * nz)
                    # the side that is seen
                    facing = nx * (x - width / 2) + ny * (y - height / 2) + nz * focal
                    size = -size if facing > 0.0 else size
                    lit = (nx * LIGHT[0] + ny * LIGHT[1] + nz * LIGHT[2]) / size if size != 0.0 else 0.0
                    shade = AMBIENT + (1.0 - AMBIENT) * max(lit, 0.0)
                    for c in range(3):
                        rgb[row, column, c] = int(min(255.0, tint[c] * shade + 0.5))

"""Haze in images: what puffs absorb, scatter and emit along the ray of each pixel, up to what stands behind them.

The optical depth of a bell along a ray has a closed form, so rays are not walked in steps: each puff, the nearest
first, takes its share of the light that is left.
"""

import math

from anysim.conventions import Array
from anysim_fields.kernels.compiling import compiled


@compiled
def haze(
    points: Array,
    size: Array,
    amount: Array,
    color: Array,
    order: Array,
    focal: float,
    near: float,
    mark: int,
    left: Array,
    half: Array,
    light: Array,
    depth: Array,
    rgb: Array,
    segmentation: Array,
) -> None:
    """Draw puffs over what is there.

    Args:
        points: (K, 3) [m] in the optical frame.
        size: (K,) [m].
        amount: (K,) [m^2] extinction of each as a whole.
        color: (K, 3) 0 to 255, of its light.
        order: (M,) those that are drawn, the nearest first.
        focal: [px].
        near: [m] what is nearer is not seen.
        mark: the segmentation id, of pixels in which less than half of the light behind is left.
        left: (H, W) of ones: the share of light that is left; changed.
        half: (H, W) of zeros: the depth [m] where half of it is left; changed.
        light: (H, W, 3) of zeros; changed.
        depth: (H, W) float32 [m]; changed to where half of the light is left.
        rgb: (H, W, 3) uint8, or of no rows.
        segmentation: (H, W) int32, or of no rows.
    """
    height, width = left.shape
    reach = 3.0
    for number in range(order.shape[0]):
        k = order[number]
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        s = size[k]
        if z - reach * s <= near:
            continue
        u, v = width / 2 + focal * x / z, height / 2 + focal * y / z
        wide = focal * reach * s / (z - reach * s) * (1.0 + 0.5 * ((x / z) ** 2 + (y / z) ** 2))
        if not (u + wide > 0.0 and u - wide < width and v + wide > 0.0 and v - wide < height):
            continue
        first, last = max(0, int(u - wide)), min(width, int(u + wide) + 2)
        top, bottom = max(0, int(v - wide)), min(height, int(v + wide) + 2)
        through = amount[k] / (2.0 * math.pi * s * s)
        for row in range(top, bottom):
            dy = (row + 0.5 - height / 2) / focal
            for column in range(first, last):
                dx = (column + 0.5 - width / 2) / focal
                long = math.sqrt(dx * dx + dy * dy + 1.0)
                at = (dx * x + dy * y + z) / long
                off = x * x + y * y + z * z - at * at
                if off > reach * reach * s * s:
                    continue
                end = depth[row, column] * long
                tau = through * math.exp(-0.5 * off / (s * s)) * 0.5 * math.erfc((at - end) / (1.4142135623730951 * s))
                before = left[row, column]
                after = before * math.exp(-tau)
                left[row, column] = after
                for i in range(3):
                    light[row, column, i] += (before - after) * color[k, i]
                if before >= 0.5 > after:
                    half[row, column] = min(end, at) / long
    for row in range(height):
        for column in range(width):
            share = left[row, column]
            if share < 0.5:
                depth[row, column] = half[row, column]
                if segmentation.shape[0]:
                    segmentation[row, column] = mark
            if share < 1.0 and rgb.shape[0]:
                for i in range(3):
                    value = light[row, column, i] + share * rgb[row, column, i]
                    rgb[row, column, i] = int(min(255.0, value + 0.5))

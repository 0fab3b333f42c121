"""Compiled pictures of a gel: its surface beside what presses into it, and its colours under coloured lights."""

import math

import numpy as np

from anysim.conventions import Array
from anysim_sensors.kernels.bounds import compiled


@compiled
def _blur(height: Array, aside: Array, weight: Array) -> None:
    """Blur an image (H, W) in place with weights (K,) of a pixel and of those on either side; edges go on."""
    rows, columns, far = height.shape[0], height.shape[1], weight.shape[0]
    for v in range(rows):
        for u in range(columns):
            total = weight[0] * height[v, u]
            for k in range(1, far):
                total += weight[k] * (height[v, max(u - k, 0)] + height[v, min(u + k, columns - 1)])
            aside[v, u] = total
    for v in range(rows):
        for u in range(columns):
            total = weight[0] * aside[v, u]
            for k in range(1, far):
                total += weight[k] * (aside[max(v - k, 0), u] + aside[min(v + k, rows - 1), u])
            height[v, u] = total


@compiled
def bulge(deep: Array, weights: Array, height: Array) -> None:
    """The depth (N, H, W) [m] of a gel that is pressed in by `deep`: as deep there, and smooth beside it.

    Args:
        deep: (N, H, W) [m], 0 where nothing touches.
        weights: (L, K) of blurs, from wide to narrow.
        height: (N, H, W) written.
    """
    aside = np.empty((deep.shape[1], deep.shape[2]))
    for e in range(deep.shape[0]):
        deepest = 0.0
        for v in range(deep.shape[1]):  # number by number: a slice takes numba a second to compile
            for u in range(deep.shape[2]):
                height[e, v, u] = deep[e, v, u]
                deepest = max(deepest, deep[e, v, u])
        if not deepest > 0.0:
            continue
        for level in range(weights.shape[0]):
            _blur(height[e], aside, weights[level])
            for v in range(deep.shape[1]):
                for u in range(deep.shape[2]):
                    if deep[e, v, u] > 0.0:
                        height[e, v, u] = deep[e, v, u]


@compiled
def shade(height: Array, right: float, down: float, background: Array, light: Array, image: Array) -> None:
    """Colours of a gel.

    Args:
        height: (N, H, W) [m] how deep it is pressed in.
        right, down: [m] from a pixel to the next.
        background: (H, W, 3) levels where nothing touches.
        light: (3, 3) what a unit of the normal (right, down, away less 1; rows) adds to red, green and blue.
        image: (N, H, W, 3) uint8 written.
    """
    rows, columns = height.shape[1], height.shape[2]
    for e in range(height.shape[0]):
        for v in range(rows):
            for u in range(columns):
                u0, u1, v0, v1 = max(u - 1, 0), min(u + 1, columns - 1), max(v - 1, 0), min(v + 1, rows - 1)
                a = (height[e, v, u0] - height[e, v, u1]) / (max(u1 - u0, 1) * right)
                b = (height[e, v0, u] - height[e, v1, u]) / (max(v1 - v0, 1) * down)
                c = 1.0 / math.sqrt(1.0 + a * a + b * b)
                for k in range(3):
                    level = background[v, u, k] + light[0, k] * a * c + light[1, k] * b * c + light[2, k] * (c - 1.0)
                    image[e, v, u, k] = np.uint8(min(max(level + 0.5, 0.0), 255.0))

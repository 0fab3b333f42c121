"""Compiled heights of the ground: tables of heights, two triangles a cell, at points beside robots."""

import math

import numpy as np

from anysim.conventions import Array
from anysim_sensors.kernels.bounds import compiled


@compiled
def sample(
    heights: Array, start: Array, shape: Array, place: Array, level: float, frames: Array, points: Array, out: Array
) -> None:
    """The height of the highest ground at points beside frames, turned with their heading.

    Args:
        heights: (H,) [m] of all fields, row by row from the lowest y, columns from the lowest x.
        start: (F,) int64, where each field begins.
        shape: (F, 2) int64, rows and columns.
        place: (F, 5) lowest x and y, cells per metre along x and y, height that is added.
        level: [m] of the highest plane, -inf for none.
        frames: (N, 7) poses, of which position and heading count.
        points: (R, 2) [m].
        out: (N, R) written [m], world frame; NaN where there is no ground.
    """
    for e in range(frames.shape[0]):
        x, y, z, w = frames[e, 3], frames[e, 4], frames[e, 5], frames[e, 6]
        c, s = 1 - 2 * (y * y + z * z), 2 * (x * y + z * w)
        length = math.sqrt(c * c + s * s)
        if length > 0.0:
            c, s = c / length, s / length
        else:  # x is upright: it has no heading
            c, s = 1.0, 0.0
        for r in range(points.shape[0]):
            px = frames[e, 0] + c * points[r, 0] - s * points[r, 1]
            py = frames[e, 1] + s * points[r, 0] + c * points[r, 1]
            best = level
            for f in range(start.shape[0]):
                rows, cols = shape[f, 0], shape[f, 1]
                u, v = (px - place[f, 0]) * place[f, 2], (py - place[f, 1]) * place[f, 3]
                if not (
                    -1e-9 <= u <= cols - 1 + 1e-9 and -1e-9 <= v <= rows - 1 + 1e-9
                ):  # also where they are no numbers
                    continue
                u, v = min(max(u, 0.0), cols - 1.0), min(max(v, 0.0), rows - 1.0)
                j, i = min(int(u), cols - 2), min(int(v), rows - 2)
                t, q = u - j, v - i
                at = start[f] + i * cols + j
                a, b = heights[at], heights[at + cols + 1]
                if t >= q:  # the edge between a cell's triangles goes from its lowest corner to its highest
                    m = heights[at + 1]
                    height = a + t * (m - a) + q * (b - m)
                else:
                    m = heights[at + cols]
                    height = a + q * (m - a) + t * (b - m)
                best = max(best, height + place[f, 4])
            out[e, r] = best if best > -np.inf and px == px and py == py else np.nan

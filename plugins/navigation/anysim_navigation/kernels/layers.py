"""Compiled floods over surfaces above each other."""

import numpy as np

from anysim.conventions import Array
from anysim.math.compiled import compiled


@compiled
def flood(level: Array, standing: Array, rise: float) -> tuple[Array, Array]:
    """The connected part (rows, columns, layers) that each surface is in, -1 where none stands, and the parts' sizes.

    Two surfaces of cells side by side are connected where one is not higher than the other by more than `rise` [m].
    """
    rows, columns, layers = level.shape
    part = np.full((rows, columns, layers), -1, dtype=np.int64)
    stack = np.empty((rows * columns * layers, 3), dtype=np.int64)
    sizes = np.zeros(rows * columns * layers + 1, dtype=np.int64)
    count = 0
    for i0 in range(rows):
        for j0 in range(columns):
            for l0 in range(layers):
                if not standing[i0, j0, l0] or part[i0, j0, l0] >= 0:
                    continue
                part[i0, j0, l0], top = count, 1
                stack[0, 0], stack[0, 1], stack[0, 2] = i0, j0, l0
                while top > 0:
                    top -= 1
                    i, j, z = stack[top, 0], stack[top, 1], level[stack[top, 0], stack[top, 1], stack[top, 2]]
                    sizes[count] += 1
                    for step in range(4):
                        u = i + (1 if step == 0 else -1 if step == 1 else 0)
                        v = j + (1 if step == 2 else -1 if step == 3 else 0)
                        if not (0 <= u < rows and 0 <= v < columns):
                            continue
                        for other in range(layers):
                            if standing[u, v, other] and part[u, v, other] < 0 and abs(level[u, v, other] - z) <= rise:
                                part[u, v, other] = count
                                stack[top, 0], stack[top, 1], stack[top, 2] = u, v, other
                                top += 1
                count += 1
    return part, sizes[:count].copy()

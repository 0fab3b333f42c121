"""Ways of cars: what turns in no less than a circle goes forwards and backwards along arcs (hybrid A*)."""

from itertools import pairwise

import numpy as np

from anysim.conventions import Array
from anysim_navigation.agent import NoRoute
from anysim_navigation.dynamic_window import distances_of
from anysim_navigation.limits import BaseLimits
from anysim_navigation.navmesh import NavMesh

CELL = 0.05
"""[m] of the field of distances."""
AT_THE_END = 0.12
"""[m] from the goal a way may end."""
MARGIN = 0.15
"""[m] within which a way costs more."""


def car_way(
    mesh: NavMesh, limits: BaseLimits, start: Array, goal: Array, room: float = 0.0
) -> list[tuple[Array, float]]:
    """Stretches (K, 2) [m] with their directions, 1 or -1, from a pose (3,) to a place (2,), `room` [m] from things.

    Raises:
        NoRoute: no such way was found.
    """
    import shapely

    from anysim_navigation.kernels import hybrid

    low, high = np.array(mesh.free.bounds[:2]) - 0.5, np.array(mesh.free.bounds[2:]) + 0.5
    middle = 0.5 * (low + high)
    columns, rows = np.ceil((high - low) / CELL).astype(int)
    x, y = (middle[k] + (np.arange(n) + 0.5 - n / 2) * CELL for k, n in ((0, columns), (1, rows)))
    xs, ys = np.meshgrid(x, y)
    on_mesh = shapely.contains_xy(mesh.free, xs, ys)
    field = distances_of((~on_mesh).astype(np.int8), CELL) + mesh.agent.radius  # from the middle of the disc to things
    field = np.where(on_mesh, field, field - 2 * distances_of(on_mesh.astype(np.int8), CELL))
    shifted, end = start - np.array([*middle, 0.0]), goal - middle
    discs = limits.discs + np.array([0.0, 0.0, room])
    least = float(discs[:, 2].min())
    i, j = ((end[::-1] / CELL) + 0.5 * np.array([rows, columns])).astype(int)
    ahead = hybrid.distances_to(field > least - CELL, int(i), int(j)) * CELL
    near, radius = AT_THE_END, float(limits.turning_radius) * 1.1  # a reserve, with which it can get back onto its way
    found = hybrid.way_of_a_car(field, CELL, ahead, discs, radius, shifted, end, near, MARGIN)
    if not len(found):
        raise NoRoute(
            f"no way of a car with a turning circle of {limits.turning_radius:g} m from "
            f"({start[0]:.2f}, {start[1]:.2f}) to ({goal[0]:.2f}, {goal[1]:.2f})"
        )
    points, gear = found[:, :2] + middle, found[1:, 3]
    if not len(gear):  # it is where it is to be
        return [(np.stack([start[:2], goal]), 1.0)]
    cuts = [0, *(np.flatnonzero(np.diff(gear)) + 1).tolist(), len(gear)]
    return [(points[a : b + 1], float(gear[a])) for a, b in pairwise(cuts) if b > a]

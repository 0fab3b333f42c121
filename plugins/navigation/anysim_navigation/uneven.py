"""Uneven ground: surfaces under a grid of rays, those that an agent can walk to, and what of them is left to a disc.

Of several surfaces above each other that are connected the highest counts: a map has one height at a place.
"""

from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.model.shapes import is_ground
from anysim_navigation.agent import Agent
from anysim_navigation.obstacles import grown
from anysim_sensors.scene import WORLD_FRAME, SceneGeometry
from anysim_sensors.tables import GeomPoses

LAYERS = 6
"""Surfaces above each other that are told apart."""
ROUNDING = 1e-5
"""[m] that a ray goes on from a surface before it looks for the next."""
OUTLINE = 0.4
"""Cells by which the outline of what is left may be simplified."""


class Surfaces(NamedTuple):
    """Levels (rows, columns, LAYERS) [m] that something could stand on, from the highest; NaN where there is none.

    `room` [m] is what is free above each, and `natural` bool says that it is ground: a plane, a height field, a mesh of
    the world. The first cell has its corner at `low` (2,) [m], `cell` is its edge.
    """

    level: Array
    room: Array
    natural: Array
    low: Array
    cell: float


class UnevenGround(NamedTuple):
    """The height (rows, columns) [m] of the ground that can be walked on; NaN where there is none."""

    height: Array
    low: Array
    cell: float

    def heights_at(self, points: Array) -> Array:
        """(K,) [m] at points (K, 2), between the middles of cells."""
        from scipy.ndimage import distance_transform_edt, map_coordinates

        known = np.isfinite(self.height)
        nearest: Any = distance_transform_edt(~known, return_distances=False, return_indices=True)
        filled = self.height[tuple(nearest)] if known.any() else np.zeros_like(self.height)
        at = (points - self.low) / self.cell - 0.5
        return np.asarray(map_coordinates(filled, [at[:, 1], at[:, 0]], order=1, mode="nearest"))


def surfaces(scene: SceneGeometry, posed: GeomPoses, seen: Array, low: Array, high: Array, cell: float) -> Surfaces:
    """What rays from above find in one env, between the corners `low` and `high` (3,) [m] of a box."""
    columns, rows = np.maximum(1, np.ceil((high[:2] - low[:2]) / cell - 1e-9)).astype(int)
    x, y = (low[k] + (np.arange(n) + 0.5) * cell for k, n in ((0, columns), (1, rows)))
    place = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    count = len(place)
    z, inside = np.full(count, high[2]), np.zeros(count, dtype=int)
    under = np.full(count, np.inf)  # the lowest underside of what is above
    level, room = np.full((2, count, LAYERS), np.nan)
    natural = np.zeros((count, LAYERS), dtype=bool)
    is_natural = np.array([is_ground(geom.shape) for geom in scene.world.geoms])
    found, going = np.zeros(count, dtype=int), np.arange(count)
    frame, down = WORLD_FRAME[None], np.array([0.0, 0.0, -1.0])
    for _ in range(4 * LAYERS):
        origins = np.concatenate([place[going], z[going, None]], axis=1)
        hits = scene.rays(posed, frame, origins, np.tile(down, (len(going), 1)), seen=seen, normals=True)
        met = np.isfinite(hits.distance[0]) & (z[going] - hits.distance[0] >= low[2])
        going, depth, upward = going[met], hits.distance[0][met], hits.normal[0][met, 2] > 0
        geom = hits.geom[0][met]
        if not len(going):
            break
        z[going] -= depth
        outside = upward & (inside[going] == 0) & (found[going] < LAYERS)
        top = going[outside]
        level[top, found[top]], room[top, found[top]] = z[top], under[top] - z[top]
        natural[top, found[top]] = is_natural[geom[outside]]
        found[top] += 1
        inside[going] += np.where(upward, 1, -1)
        inside[going] = np.maximum(inside[going], 0)
        bottom = going[~upward & (inside[going] == 0)]
        under[bottom] = z[bottom]
        z[going] -= ROUNDING
    shape = (rows, columns, LAYERS)
    return Surfaces(level.reshape(shape), room.reshape(shape), natural.reshape(shape), np.array(low[:2]), cell)


def walkable(found: Surfaces, agent: Agent) -> UnevenGround:
    """Where the agent has room, goes no steeper than it can and steps no higher, and gets to from ground.

    Tops of furniture are no ground, so nothing gets there that does not find a ramp. In a world without any the largest
    connected surface counts.
    """
    from anysim_navigation.kernels.layers import flood

    standing = found.room >= agent.height
    rise = max(agent.step, found.cell * np.tan(agent.slope)) + 1e-6
    part, sizes = flood(found.level, standing, rise)
    reached = np.unique(part[found.natural & standing])
    if not len(reached) and len(sizes):
        reached = sizes.argmax()[None]
    kept = np.where(np.isin(part, reached) & standing, found.level, -np.inf)
    height = kept.max(axis=2)
    height[np.isneginf(height)] = np.nan
    steep = _slope(height, found.cell) > np.tan(agent.slope) + 1e-6
    height[steep | _beside_a_drop(height, rise)] = np.nan
    return UnevenGround(height, found.low, found.cell)


def free_of(ground: UnevenGround, agent: Agent) -> Any:
    """The polygons where the middle of the agent may be: off all cells that cannot be walked on, by the radius."""
    import shapely

    blocked = np.pad(~np.isfinite(ground.height), 1, constant_values=True)
    low, cell = ground.low - ground.cell, ground.cell
    runs: list[Array] = []
    for row, line in enumerate(blocked):
        change = np.flatnonzero(np.diff(np.concatenate([[0], line.astype(np.int8), [0]])))
        y = low[1] + row * cell
        for a, b in change.reshape(-1, 2):
            x0, x1 = low[0] + a * cell, low[0] + b * cell
            runs.append(np.array([[x0, y], [x1, y], [x1, y + cell], [x0, y + cell]]))
    off = OUTLINE * cell
    wide = grown(runs, agent.radius + off).simplify(off)
    rows, columns = ground.height.shape
    whole = shapely.box(*ground.low, *(ground.low + cell * np.array([columns, rows])))
    return whole.difference(wide)


def _slope(height: Array, cell: float) -> Array:
    """(rows, columns) the steepness of the plane through a cell and those two to each side; 0 where some lack."""
    wide = np.pad(height, 2, constant_values=np.nan)
    across = (2 * (wide[2:-2, 4:] - wide[2:-2, :-4]) + wide[2:-2, 3:-1] - wide[2:-2, 1:-3]) / (10 * cell)
    along = (2 * (wide[4:, 2:-2] - wide[:-4, 2:-2]) + wide[3:-1, 2:-2] - wide[1:-3, 2:-2]) / (10 * cell)
    return np.hypot(np.nan_to_num(across), np.nan_to_num(along))


def _beside_a_drop(height: Array, rise: float) -> Array:
    """(rows, columns) bool: a cell at one of its four sides is higher or lower by more than the agent steps."""
    beside = np.zeros(height.shape, dtype=bool)
    for axis in (0, 1):
        jump = np.abs(np.diff(height, axis=axis)) > rise
        beside |= np.pad(jump, [(0, 1) if k == axis else (0, 0) for k in (0, 1)])
        beside |= np.pad(jump, [(1, 0) if k == axis else (0, 0) for k in (0, 1)])
    return beside

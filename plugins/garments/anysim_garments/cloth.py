"""A garment as skills and terms see it: points by where they are in its own plane, and the area that it covers."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.families.base import FamilyState
from anysim.math import pose as P
from anysim.task.scene import SceneView
from anysim.task.slot_frames import CategoryView

Coordinate = Annotated[float, Field(ge=-1.0, le=1.0)]
Spot = Annotated[
    tuple[Coordinate, Coordinate],
    Field(description="a point of the garment as it lies flat, from -1 to 1 along x and y: [1, 1] is a corner"),
]
CELL = 0.01
"""[m] of the grid on which covered area is counted."""


class Cloth:
    """A garment in the envs that a scene looks at, n of them.

    Attributes:
        flat: (V, 2) where its points are in its own plane, -1 to 1.
        faces: (F, 3) its triangles.
        area: [m^2] of its outline as it lies flat.
    """

    def __init__(self, scene: SceneView, category: CategoryView) -> None:
        """Raises TaskError where it is no garment."""
        self.scene, self.name = scene, category.name
        if scene.families is None or scene.families.points(self.name) is None:
            raise TaskError(f"'{self.name}' is no family of matter; name a garment of world.families")
        state = scene.families.state(self.name, np.array([0]))
        if "flat" not in state.fields:
            raise TaskError(f"'{self.name}' is no garment: its points have no place in a plane of its own")
        flat = state.fields["flat"][0]
        self._half = np.ptp(flat, axis=0) / 2
        self.flat, self.faces = flat / self._half, state.faces
        lying = np.column_stack([flat, np.zeros(len(flat))])[None]
        self.area = float(covered(lying, self.faces)[0])

    def state(self) -> FamilyState:
        """What it looks like now."""
        assert self.scene.families is not None
        return self.scene.families.state(self.name, self.scene.env_ids)

    def nearest(self, spots: Sequence[tuple[float, float]]) -> Array:
        """(s,) the points nearest to places in its own plane."""
        away = (self.flat[None] - np.array(spots)[:, None]) * self._half
        return np.argmin(P.norm(away), axis=1)

    def held_near(self, places: Array, within: float = 0.06) -> Array:
        """(n,) bool: a pad holds it at a point within so much [m] of places (n, 3)."""
        state = self.state()
        near = P.norm(state.points - places[:, None]) < within
        return np.logical_or.reduce(near & state.fields["held"], axis=1)

    def laid_out(self, number: int, by: Array, points: Array) -> Array:
        """(n, 3) where a point would be if it lay flat with points `by` (b,) where they are; of points (n, V, 3)."""
        flat = self.flat * self._half
        here, there = points[:, by, :2], flat[by]
        middle, origin = here.mean(axis=1), there.mean(axis=0)
        a, b = there - origin, here - middle[:, None]
        cosine = (a * b).sum(axis=(1, 2))
        sine = (a[:, 0] * b[..., 1] - a[:, 1] * b[..., 0]).sum(axis=1)
        turn = np.arctan2(sine, cosine)
        x, y = flat[number] - origin
        place = np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y], axis=1)
        return np.column_stack([middle + place, points[:, by, 2].mean(axis=1)])


def covered(points: Array, faces: Array, cell: float = CELL) -> Array:
    """(n,) [m^2] that triangles of points (n, V, 3) cover as they are seen from above, each place once.

    A cell of a grid counts where its middle is in a triangle.
    """
    corners = points[:, faces, :2] / cell
    low, high = np.floor(corners.min(axis=2)).astype(int), np.ceil(corners.max(axis=2)).astype(int)
    window = int((high - low).max(initial=0))
    if not np.isfinite(points).all() or window > 64:
        return np.zeros(len(points))
    grid = np.stack(np.meshgrid(np.arange(window), np.arange(window), indexing="ij"), axis=-1).reshape(-1, 2)
    places = low[:, :, None] + grid
    away = places + 0.5 - corners[:, :, :1]
    a, b = (corners[:, :, i, None] - corners[:, :, 0, None] for i in (1, 2))
    size = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    size = np.where(np.abs(size) < 1e-9, np.inf, size)
    u = (away[..., 0] * b[..., 1] - away[..., 1] * b[..., 0]) / size
    v = (a[..., 0] * away[..., 1] - a[..., 1] * away[..., 0]) / size
    inside = (u >= 0) & (v >= 0) & (u + v <= 1) & np.isfinite(size)
    found = np.zeros(len(points))
    for row in range(len(points)):
        found[row] = len(np.unique(places[row][inside[row]], axis=0)) * cell**2
    return found

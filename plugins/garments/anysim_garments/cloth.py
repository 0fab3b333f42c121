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
NEAR = 0.015
"""[m] within which a point lies as it should."""
ASIDE = 0.012
"""[m] that a hand may come down beside the point that it is to hold."""
GATHERED = 0.06
"""[m] from a point on a bulge to where fingers pinch the cloth below."""
_TURNS = np.arange(16) * np.pi / 8
ASIDES = np.concatenate([np.zeros((1, 2)), ASIDE * np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=1)])
"""(17, 2) [m] places that are tried."""


class Cloth:
    """A garment in the envs that a scene looks at, n of them.

    Attributes:
        flat: (V, 2) where its points are in its own plane, -1 to 1.
        faces: (F, 3) its triangles.
        area: [m^2] of its outline as it lies flat.
        pinched: a hand holds it by friction, which takes it some time to close.
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
        self.pinched = "pinched" in state.fields
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

    def hanging(self, numbers: Array) -> tuple[float, float]:
        """[m] of cloth held at points `numbers` (2,): how far they are apart when taut, and how far down it hangs.

        As it lies flat.
        """
        flat = self.flat * self._half
        one, edge = flat[numbers[0]], flat[numbers[1]] - flat[numbers[0]]
        width = float(P.norm(edge))
        down = np.abs(edge[0] * (flat - one)[:, 1] - edge[1] * (flat - one)[:, 0]) / max(width, 1e-9)
        return width, float(down.max())

    def aim(self, numbers: Array, points: Array, above: float) -> Array:
        """(n, 3) [m] places `above` points `numbers` (n,), of points (n, V, 3), for a hand that is to hold just these.

        Where another layer is nearer to a hand straight above, it comes down beside the point.
        """
        rows = np.arange(len(points))
        asides = np.concatenate([ASIDES, np.full((len(ASIDES), 1), above)], axis=1)
        away = points - points[rows, numbers, None]
        others = P.norm(away[:, :, None] - asides)  # (n, V, directions)
        others[rows, numbers] = np.inf
        lead = others.min(axis=1) - P.norm(asides)
        return points[rows, numbers] + asides[np.argmax(lead, axis=1)]

    def holds(self, at: Array, numbers: Array) -> Array:
        """(n,) bool: a pad holds points `numbers` (n,) in the rows `at` of the scene, or pinches the cloth near them.

        Fingers that pinch gather what lies between them: the point that they came for is then on the bulge above them.
        """
        state = self.state()
        held = state.fields["held"][at, numbers]
        if self.pinched:
            points = state.points[at]
            away = P.norm(points - points[np.arange(len(at)), numbers, None])
            held = held | np.logical_or.reduce(state.fields["pinched"][at] & (away < GATHERED), axis=1)
        return held

    def held_near(self, places: Array, within: float = 0.06) -> Array:
        """(n,) bool: a pad holds it at a point within so much [m] of places (n, 3)."""
        state = self.state()
        near = P.norm(state.points - places[:, None]) < within
        return np.logical_or.reduce(near & state.fields["held"], axis=1)

    def laid_out(self, numbers: Array, by: Array, points: Array) -> Array:
        """(n, 3) where points `numbers` (n,) would be if they lay flat with points `by` (b,) where they are.

        Of points (n, V, 3).
        """
        flat = self.flat * self._half
        here, there = points[:, by, :2], flat[by]
        middle, origin = here.mean(axis=1), there.mean(axis=0)
        a, b = there - origin, here - middle[:, None]
        cosine = (a * b).sum(axis=(1, 2))
        sine = (a[:, 0] * b[..., 1] - a[:, 1] * b[..., 0]).sum(axis=1)
        turn = np.arctan2(sine, cosine)
        x, y = (flat[numbers] - origin).T
        place = np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y], axis=1)
        return np.column_stack([middle + place, points[:, by, 2].mean(axis=1)])

    def as_most_lies(self, points: Array) -> Array:
        """(n, V, 3) where all points would be if they lay flat as most of them do already, of points (n, V, 3).

        Each triangle says where the others would be, one side up or the other; the one with which most agree is right.
        """
        one, found = self.flat * self._half @ np.array([1.0, 1.0j]), points[..., 0] + 1j * points[..., 1]
        laid = np.empty_like(points)
        for row, here in enumerate(found):
            best = (-1, one, np.zeros(len(one), dtype=bool))
            for flat in (one, one.conj()):
                place = _fitted(flat, here, self.faces)
                near = np.abs(place - here) < NEAR
                most = int(np.argmax(near.sum(axis=1)))
                best = max(best, (int(near[most].sum()), flat, near[most]), key=lambda said: said[0])
            _, flat, agrees = best
            place = _fitted(flat, here, np.flatnonzero(agrees)[None])[0]
            laid[row] = np.stack([place.real, place.imag, np.full(len(place), points[row, agrees, 2].mean())], axis=1)
        return laid


def _fitted(flat: Array, here: Array, groups: Array) -> Array:
    """(g, V) where points (V,), complex, are if they lie as groups of them (g, k) are `here`."""
    a, b = flat[groups], here[groups]
    origin, middle = a.mean(axis=1), b.mean(axis=1)
    turn = ((a - origin[:, None]).conj() * (b - middle[:, None])).sum(axis=1)
    turn /= np.maximum(np.abs(turn), 1e-12)
    return middle[:, None] + turn[:, None] * (flat - origin[:, None])


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

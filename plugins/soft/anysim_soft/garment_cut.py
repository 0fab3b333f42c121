"""Cuts of garments as triangles in the plane: a towel, and a T-shirt of one piece or of two that are sewn together."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim_soft.garment_spec import GarmentSpec, ShirtSpec

SAME = 1e-9
"""[m] within which a point is on a line."""


class Cut(NamedTuple):
    """A garment as it lies flat.

    Attributes:
        points: (V, 2) [m] about the middle of its outline.
        side: (V,) 1 of its front, -1 of its back, 0 of seams and of what has one piece.
        faces: (F, 3) counter-clockwise as they are seen from the front.
        hinges: (H, 4) an edge and the points opposite to it, of triangles of one piece that share it.
    """

    points: Array
    side: Array
    faces: Array
    hinges: Array

    @property
    def size(self) -> Array:
        """(2,) [m] of its outline's box."""
        return np.ptp(self.points, axis=0)

    def areas(self) -> Array:
        """(F,) [m^2]."""
        a, b = (self.points[self.faces[:, i]] - self.points[self.faces[:, 0]] for i in (1, 2))
        return np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2

    def shares(self) -> Array:
        """(V,) [m^2] of cloth that each point stands for."""
        return np.bincount(self.faces.ravel(), np.repeat(self.areas() / 3, 3), len(self.points))


def cut_of(spec: GarmentSpec) -> Cut:
    """The cut that the parameters ask for."""
    if spec.towel is not None:
        width, length = spec.towel
        points, faces = _grid(_lines([0.0, width], spec.spacing), _lines([0.0, length], spec.spacing))
        return _flat(points, faces)
    assert spec.shirt is not None
    return _shirt(spec.shirt, spec.spacing)


def _shirt(spec: ShirtSpec, spacing: float) -> Cut:
    half, neck, reach = spec.chest / 2, spec.neck[0] / 2, spec.chest / 2 + spec.sleeve
    low, cut = spec.length - spec.cuff, spec.length - spec.neck[1]
    x = _lines([-reach, -half, -neck, neck, half, reach], spacing)
    y = _lines(sorted({0.0, low, cut, spec.length}), spacing)

    def there(place: Array) -> Array:
        aside = np.abs(place[:, 0])
        return ((aside < half) | (place[:, 1] > low)) & ~((aside < neck) & (place[:, 1] > cut))

    points, faces = _grid(x, y, there)
    aside = np.abs(points[:, 0])
    hem, cuffs = points[:, 1] < SAME, aside > reach - SAME
    throat = (aside < neck + SAME) & (points[:, 1] > cut - SAME)
    points[:, 1] -= spec.slope * np.maximum(aside - half, 0.0)
    if spec.panels == 1:
        return _flat(points, faces)
    return _sewn(_flat(points, faces), (hem, cuffs, throat))


def _lines(stops: Sequence[float], spacing: float) -> Array:
    """Through all stops, and evenly between them, `spacing` apart at most."""
    parts = [np.linspace(a, b, max(1, int(np.ceil((b - a) / spacing - 1e-6))) + 1)[:-1] for a, b in pairwise(stops)]
    return np.append(np.concatenate(parts), stops[-1])


def _grid(x: Array, y: Array, there: Callable[[Array], Array] | None = None) -> tuple[Array, Array]:
    """Points and triangles of those rectangles of a grid whose middle is `there`; diagonals alternate."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(len(x) - 1), np.arange(len(y) - 1), indexing="ij"))
    if there is not None:
        kept = there(np.stack([(x[i] + x[i + 1]) / 2, (y[j] + y[j + 1]) / 2], axis=1))
        i, j = i[kept], j[kept]
    a, b, c, d = (k * len(y) + m for k, m in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)))
    even = ((i + j) % 2 == 0)[:, None]
    one = np.where(even, np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1))
    two = np.where(even, np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1))
    faces = np.stack([one, two], axis=1).reshape(-1, 3)
    used, faces = np.unique(faces, return_inverse=True)
    return np.stack([x[used // len(y)], y[used % len(y)]], axis=1), faces.reshape(-1, 3)


def _flat(points: Array, faces: Array) -> Cut:
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2
    return Cut(points, np.zeros(len(points)), faces, _hinges(faces)[0])


def _hinges(faces: Array) -> tuple[Array, Array]:
    """(H, 4) as `Cut.hinges`, and (B, 2) the edges that only one triangle has."""
    edges = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    opposite = faces[:, [2, 0, 1]].ravel()
    order = np.lexsort(np.sort(edges, axis=1).T)
    ends, opposite = np.sort(edges, axis=1)[order], opposite[order]
    twin = np.flatnonzero((ends[1:] == ends[:-1]).all(axis=1))
    alone = np.setdiff1d(np.arange(len(ends)), np.concatenate([twin, twin + 1]))
    return np.column_stack([ends[twin], opposite[twin], opposite[twin + 1]]), ends[alone]


def _sewn(front: Cut, openings: Sequence[Array]) -> Cut:
    """Two pieces of one form, sewn along their outline but for edges with both ends in one opening."""
    _, outline = _hinges(front.faces)
    opened = np.zeros(len(outline), dtype=bool)
    for opening in openings:
        opened |= opening[outline].all(axis=1)
    seam = np.zeros(len(front.points), dtype=bool)
    seam[outline[~opened]] = True
    back = np.arange(len(seam))
    back[~seam] = len(seam) + np.arange((~seam).sum())
    points = np.concatenate([front.points, front.points[~seam]])
    side = np.concatenate([np.where(seam, 0.0, 1.0), -np.ones((~seam).sum())])
    faces = np.concatenate([front.faces, back[front.faces][:, ::-1]])
    return Cut(points, side, faces, np.concatenate([front.hinges, back[front.hinges]]))

"""Heights of the ground from the neutral geometry: below points, and the highest below rectangles. Exact.

A height field is two triangles a cell. The edge between them goes from the corner of lowest x and y to that of highest
x and y, as on every engine. Where pieces of ground lie above each other, the highest counts.
"""

from typing import Protocol

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.model.world import HeightField, HeightFieldShape, MeshShape, Plane, World


class Relief(Protocol):
    """A piece of ground in its own frame."""

    def heights_at(self, points: Array) -> Array:
        """Heights (...) [m] at points (..., 2); -inf where there is no ground."""
        ...

    def top_of(self, low: Array, high: Array) -> float:
        """The greatest height [m] over the rectangle from `low` to `high` (2,); -inf where there is no ground."""
        ...


class FieldGround:
    """A height field."""

    def __init__(self, field: HeightField) -> None:
        self._h = np.asarray(field.heights, dtype=float)
        rows, cols = self._h.shape
        self._half = np.array(field.size) / 2
        self._step = np.array([field.size[0] / (cols - 1), field.size[1] / (rows - 1)])
        self._last = np.array([cols - 1, rows - 1])

    def heights_at(self, points: Array) -> Array:
        """See `Relief`."""
        u, v = ((points[..., k] + self._half[k]) / self._step[k] for k in (0, 1))
        right, back = self._last
        inside = (u >= -1e-9) & (u <= right + 1e-9) & (v >= -1e-9) & (v <= back + 1e-9)
        return np.where(inside, self._height(np.clip(u, 0, right), np.clip(v, 0, back)), -np.inf)

    def _height(self, u: Array, v: Array) -> Array:
        """Heights at places along x and y, counted in cells."""
        j = np.minimum(u.astype(int), self._last[0] - 1)
        i = np.minimum(v.astype(int), self._last[1] - 1)
        t, s = u - j, v - i
        h, stride = self._h.reshape(-1), self._h.shape[1]
        corner = i * stride + j
        a, c = h.take(corner), h.take(corner + stride + 1)
        middle = h.take(corner + np.where(t >= s, 1, stride))  # the corner off the common edge
        far, near = np.maximum(t, s), np.minimum(t, s)
        return a + far * (middle - a) + near * (c - middle)

    def top_of(self, low: Array, high: Array) -> float:
        """It is at a corner of the rectangle, or of one of the pieces that the triangles cut it into."""
        if (high < -self._half).any() or (low > self._half).any():
            return -np.inf
        a, b = (np.clip((v + self._half) / self._step, 0, self._last) for v in (low, high))
        u, v = (np.array([a[k], *range(int(np.ceil(a[k])), int(b[k]) + 1), b[k]]) for k in (0, 1))
        places = [np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)]
        for x in (a[0], b[0]):  # where an edge of the rectangle crosses the diagonals, x - y is a whole number
            y = x - np.arange(np.ceil(x - b[1]), np.floor(x - a[1]) + 1)
            places.append(np.stack([np.full_like(y, x), y], axis=-1))
        for y in (a[1], b[1]):
            x = y + np.arange(np.ceil(a[0] - y), np.floor(b[0] - y) + 1)
            places.append(np.stack([x, np.full_like(x, y)], axis=-1))
        return float(self._height(*np.clip(np.concatenate(places), 0, self._last).T).max())


class MeshGround:
    """A triangle mesh, seen from above; triangles that stand upright are their upper edges."""

    SIDE = 256
    """Most buckets along an axis."""

    def __init__(self, vertices: Array, faces: Array) -> None:
        corners = np.asarray(vertices, dtype=float)[np.asarray(faces, dtype=int)]
        self._corners = corners
        self._low, self._high = corners.min(axis=1), corners.max(axis=1)
        self._from, to = self._low[:, :2].min(axis=0), self._high[:, :2].max(axis=0)
        self._side = int(np.clip(np.sqrt(len(corners)), 1, self.SIDE))
        self._step = np.maximum((to - self._from) / self._side, 1e-12)
        first, last = self._bucket(self._low[:, :2]), self._bucket(self._high[:, :2])
        counts = last - first + 1
        total = counts.prod(axis=1)
        triangle = np.repeat(np.arange(len(corners)), total)
        number = np.arange(len(triangle)) - np.repeat(np.cumsum(total) - total, total)
        across = counts[triangle, 0]
        bucket = (first[triangle, 1] + number // across) * self._side + first[triangle, 0] + number % across
        order = np.argsort(bucket, kind="stable")
        self._members = triangle[order]
        self._start = np.searchsorted(bucket[order], np.arange(self._side**2 + 1))

    def _bucket(self, points: Array) -> Array:
        return np.clip(((points - self._from) / self._step).astype(int), 0, self._side - 1)

    def heights_at(self, points: Array) -> Array:
        """See `Relief`."""
        flat = np.reshape(points, (-1, 2))
        bucket = self._bucket(flat)
        number = bucket[:, 1] * self._side + bucket[:, 0]
        begin, count = self._start[number], self._start[number + 1] - self._start[number]
        row = np.repeat(np.arange(len(flat)), count)
        member = self._members[np.repeat(begin - (np.cumsum(count) - count), count) + np.arange(len(row))]
        height = np.full(len(flat), -np.inf)
        np.maximum.at(height, row, _over(self._corners[member], flat[row]))
        return np.reshape(height, np.shape(points)[:-1])

    def top_of(self, low: Array, high: Array) -> float:
        """The highest corner of the triangles cut to the rectangle."""
        near = ((self._high[:, :2] >= low) & (self._low[:, :2] <= high)).all(axis=1)
        if not near.any():
            return -np.inf
        corners = self._corners[near]
        points = corners.reshape(-1, 3)
        inside = points[((points[:, :2] >= low) & (points[:, :2] <= high)).all(axis=1), 2]
        found = [inside]
        one, two = corners.reshape(-1, 3), np.roll(corners, -1, axis=1).reshape(-1, 3)
        for axis, other in ((0, 1), (1, 0)):
            for wall in (low[axis], high[axis]):
                run = two[:, axis] - one[:, axis]
                with np.errstate(divide="ignore", invalid="ignore"):
                    share = (wall - one[:, axis]) / run
                    across = one[:, other] + share * (two[:, other] - one[:, other])
                    hit = (share >= 0) & (share <= 1) & (across >= low[other]) & (across <= high[other])
                    found.append((one[:, 2] + share * (two[:, 2] - one[:, 2]))[hit])
        ends = np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])])
        found.append(self.heights_at(ends))
        return float(np.concatenate(found).max(initial=-np.inf))


def _over(corners: Array, points: Array) -> Array:
    """Heights (K,) of triangles (K, 3, 3) at points (K, 2); -inf beside them."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    one, two, to = b - a, c - a, points - a[:, :2]
    area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (to[:, 0] * two[:, 1] - to[:, 1] * two[:, 0]) / area
        s = (one[:, 0] * to[:, 1] - one[:, 1] * to[:, 0]) / area
    inside = (np.abs(area) > 1e-18) & (t >= -1e-9) & (s >= -1e-9) & (t + s <= 1 + 1e-9)
    return np.where(inside, a[:, 2] + np.nan_to_num(t) * one[:, 2] + np.nan_to_num(s) * two[:, 2], -np.inf)


class _Level:
    """A plane."""

    def heights_at(self, points: Array) -> Array:
        """See `Relief`."""
        return np.zeros(np.shape(points)[:-1])

    def top_of(self, low: Array, high: Array) -> float:
        """See `Relief`."""
        return 0.0


class Ground:
    """All ground of a World: the planes, height fields and concave meshes that are fixed to the world and collide."""

    def __init__(self, world: World) -> None:
        fields = {field.name: field for field in world.heightfields}
        meshes = {mesh.name: mesh for mesh in world.meshes}
        self._pieces: list[tuple[Array, Relief]] = []
        for geom in world.geoms:
            if geom.body != WORLD or not geom.collides:
                continue
            place = np.array(geom.position, dtype=float)
            match geom.shape:
                case Plane():
                    self._pieces.append((place, _Level()))
                case HeightFieldShape(name):
                    self._pieces.append((place, FieldGround(fields[name])))
                case MeshShape(name, concave=True):
                    mesh = meshes[name]
                    self._pieces.append((place, MeshGround(np.asarray(mesh.vertices), np.asarray(mesh.faces))))
                case _:
                    pass

    def heights_at(self, points: Array) -> Array:
        """Heights (...) [m] of the ground at points (..., 2) or (..., 3), world frame; NaN where there is none."""
        flat = np.asarray(points, dtype=float)[..., :2]
        height = np.full(flat.shape[:-1], -np.inf)
        for place, piece in self._pieces:
            height = np.maximum(height, piece.heights_at(flat - place[:2]) + place[2])
        return np.where(np.isfinite(height), height, np.nan)

    def top(self, low: Array, high: Array) -> Array:
        """The greatest height (...) [m] under rectangles from `low` to `high` (..., 2); NaN where there is none."""
        low, high = np.broadcast_arrays(np.asarray(low, dtype=float), np.asarray(high, dtype=float))
        height = np.full(low.shape[:-1], -np.inf)
        for place, piece in self._pieces:
            flat = [np.reshape(v - place[:2], (-1, 2)) for v in (low, high)]
            tops = [piece.top_of(a, b) for a, b in zip(*flat, strict=True)]
            height = np.maximum(height, np.reshape(tops, height.shape) + place[2])
        return np.where(np.isfinite(height), height, np.nan)

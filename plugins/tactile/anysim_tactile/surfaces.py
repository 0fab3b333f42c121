"""Surfaces of taxels: points of an undeformed skin with outward normals, in a frame of the sensor."""

from math import prod
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import AnysimError

Count = Annotated[int, Field(ge=1)]
Length = Annotated[float, Field(gt=0)]


class Surface(NamedTuple):
    """T taxels, or pixels of a gel.

    Attributes:
        shape: of the taxels, as (rows, columns) of a grid; its product is T.
        points: (T, 3) [m].
        normals: (T, 3) unit, outward.
        right: (T, 3) unit tangents; along the columns of a grid. The other tangent is the normal across it.
        area: (T,) [m^2] of the skin that each stands for.
        pitch: [m] from one to the next, the largest.
    """

    shape: tuple[int, ...]
    points: Array
    normals: Array
    right: Array
    area: Array
    pitch: float

    @property
    def up(self) -> Array:
        """(T, 3) unit: the other tangent."""
        return np.cross(self.normals, self.right)


def scattered(points: ArrayLike, normals: ArrayLike, area: float) -> Surface:
    """Taxels at points, each of the same area [m^2]; one normal for all, or one for each.

    Raises:
        AnysimError: a normal is zero, or there are not as many as points.
    """
    at, out = np.array(points, dtype=float), np.atleast_2d(np.array(normals, dtype=float))
    if len(out) not in (1, len(at)):
        raise AnysimError(f"give one normal for all {len(at)} points, or one for each; there are {len(out)}")
    length = np.linalg.norm(out, axis=1, keepdims=True)
    if not length.min() > 0:
        raise AnysimError("a normal has no direction: it is zero")
    out = np.broadcast_to(out / length, at.shape).copy()
    apart = np.linalg.norm(at[:, None] - at[None], axis=-1) + np.diag(np.full(len(at), np.inf))
    pitch = float(apart.min(axis=1).max()) if len(at) > 1 else float(np.sqrt(area))
    return Surface((len(at),), at, out, _right(out), np.full(len(at), area), pitch)


def flat(size: tuple[float, float], grid: tuple[int, int]) -> Surface:
    """A rectangle of width and height [m] about the origin, z outward, of (rows, columns); rows from the lowest y."""
    rows, columns = grid
    x, y = _middles(size[0], columns), _middles(size[1], rows)
    points = np.stack([*np.meshgrid(x, y), np.zeros((rows, columns))], axis=-1).reshape(-1, 3)
    normals = np.broadcast_to([0.0, 0.0, 1.0], points.shape).copy()
    area = np.full(len(points), prod(size) / len(points))
    return Surface((rows, columns), points, normals, _right(normals), area, max(size[0] / columns, size[1] / rows))


def spherical(radius: float, angles: tuple[float, float], grid: tuple[int, int]) -> Surface:
    """A cap of a sphere about the origin, +-angles [rad] about y (columns) and x (rows) from its middle on z."""
    rows, columns = grid
    u, v = np.meshgrid(np.tan(_middles(2 * angles[0], columns)), np.tan(_middles(2 * angles[1], rows)))
    along = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3)
    length = np.linalg.norm(along, axis=1)
    normals = along / length[:, None]
    du, dv = 2 * angles[0] / columns, 2 * angles[1] / rows  # of the angles; a tangent of them grows by 1 + its square
    spread = (1 + along[:, 0] ** 2) * du * (1 + along[:, 1] ** 2) * dv
    right = np.array([1.0, 0.0, 0.0]) - normals[:, :1] * normals
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    area = radius**2 * spread / length**3
    return Surface((rows, columns), radius * normals, normals, right, area, radius * max(du, dv))


def cylindrical(radius: float, angle: float, length: float, grid: tuple[int, int]) -> Surface:
    """A strip of a cylinder about y, +-angle [rad] from its middle on z (columns) and of a length [m] (rows)."""
    rows, columns = grid
    u, v = np.meshgrid(_middles(2 * angle, columns), _middles(length, rows))
    normals = np.stack([np.sin(u), np.zeros_like(u), np.cos(u)], axis=-1).reshape(-1, 3)
    right = np.stack([np.cos(u), np.zeros_like(u), -np.sin(u)], axis=-1).reshape(-1, 3)
    points = radius * normals + np.stack([np.zeros_like(v), v, np.zeros_like(v)], axis=-1).reshape(-1, 3)
    step = radius * 2 * angle / columns, length / rows
    return Surface((rows, columns), points, normals, right, np.full(len(points), prod(step)), max(step))


def _middles(length: float, count: int) -> Array:
    """(count,) the middles of equal parts of a length about 0."""
    return (np.arange(count) + 0.5 - count / 2) * (length / count)


def _right(normals: Array) -> Array:
    """(T, 3) unit tangents: x where it is one, and what is nearest to it elsewhere; y where the normal is x."""
    x = np.array([1.0, 0.0, 0.0]) - normals[:, :1] * normals
    y = np.array([0.0, 1.0, 0.0]) - normals[:, 1:2] * normals
    right = np.where(np.abs(normals[:, :1]) < 0.99, x, y)
    return right / np.linalg.norm(right, axis=1, keepdims=True)

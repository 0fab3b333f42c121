"""Surfaces of taxels: points of an undeformed skin with outward normals, in a frame of the sensor."""

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


def flat(size: tuple[float, float], grid: tuple[int, int], *, pixels: bool = False) -> Surface:
    """A rectangle of width and height [m] about the origin, z outward, of (rows, columns); rows from the lowest y.

    Taxels stand from edge to edge, so that they carry a force on the edge; pixels in the middles of equal cells.
    """
    x, dx = _along(size[0], grid[1], pixels)
    y, dy = _along(size[1], grid[0], pixels)
    points = np.stack([*np.meshgrid(x, y), np.zeros(grid)], axis=-1).reshape(-1, 3)
    normals = np.broadcast_to([0.0, 0.0, 1.0], points.shape).copy()
    return Surface(grid, points, normals, _right(normals), np.outer(dy, dx).ravel(), float(max(dx.max(), dy.max())))


def spherical(radius: float, angles: tuple[float, float], grid: tuple[int, int], *, pixels: bool = False) -> Surface:
    """A cap of a sphere about the origin, +-angles [rad] about y (columns) and x (rows) from its middle on z."""
    x, dx = _along(2 * angles[0], grid[1], pixels)
    y, dy = _along(2 * angles[1], grid[0], pixels)
    u, v = np.meshgrid(np.tan(x), np.tan(y))
    along = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3)
    length = np.linalg.norm(along, axis=1)
    normals = along / length[:, None]
    spread = (
        np.outer(dy, dx).ravel() * (1 + along[:, 0] ** 2) * (1 + along[:, 1] ** 2)
    )  # a tangent grows by 1 + its square
    right = np.array([1.0, 0.0, 0.0]) - normals[:, :1] * normals
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    pitch = radius * float(max(dx.max(), dy.max()))
    return Surface(grid, radius * normals, normals, right, radius**2 * spread / length**3, pitch)


def cylindrical(radius: float, angle: float, length: float, grid: tuple[int, int], *, pixels: bool = False) -> Surface:
    """A strip of a cylinder about y, +-angle [rad] from its middle on z (columns) and of a length [m] (rows)."""
    x, dx = _along(2 * angle, grid[1], pixels)
    y, dy = _along(length, grid[0], pixels)
    u, v = (values.ravel() for values in np.meshgrid(x, y))
    normals = np.stack([np.sin(u), np.zeros_like(u), np.cos(u)], axis=-1)
    right = np.stack([np.cos(u), np.zeros_like(u), -np.sin(u)], axis=-1)
    points = radius * normals + np.stack([np.zeros_like(v), v, np.zeros_like(v)], axis=-1)
    pitch = float(max(radius * dx.max(), dy.max()))
    return Surface(grid, points, normals, right, radius * np.outer(dy, dx).ravel(), pitch)


def _along(length: float, count: int, pixels: bool) -> tuple[Array, Array]:
    """(count,) places about 0 along a length, and (count,) the lengths that they stand for."""
    if pixels or count == 1:
        return (np.arange(count) + 0.5 - count / 2) * (length / count), np.full(count, length / count)
    step = length / (count - 1)
    share = np.full(count, step)
    share[[0, -1]] = step / 2
    return (np.arange(count) - (count - 1) / 2) * step, share


def _right(normals: Array) -> Array:
    """(T, 3) unit tangents: x where it is one, and what is nearest to it elsewhere; y where the normal is x."""
    x = np.array([1.0, 0.0, 0.0]) - normals[:, :1] * normals
    y = np.array([0.0, 1.0, 0.0]) - normals[:, 1:2] * normals
    right = np.where(np.abs(normals[:, :1]) < 0.99, x, y)
    return right / np.linalg.norm(right, axis=1, keepdims=True)

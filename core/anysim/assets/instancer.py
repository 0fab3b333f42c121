"""Hundreds of equal rigid bodies as one entity: one model, repeated on a grid."""

from dataclasses import replace
from math import ceil

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.geometry.bounds import shape_bounds
from anysim.math import pose as P
from anysim.model.rounding import split
from anysim.model.world import BodyKind, HeightFieldShape, Plane

_AT_ORIGIN = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def grid(count: int, cell: Array, columns: tuple[int, int] | None = None) -> Array:
    """Places (count, 3) [m] of equal cells (3,) around the first, which is in the middle of the lowest layer.

    Layer by layer upward, each filled from its middle outward. Every other layer is a quarter of a cell aside, so that
    balls do not stand on each other in columns. Without `columns` (along x and y) the whole is as high as it is wide,
    by number.
    """
    side = max(1, round(count ** (1 / 3)))
    nx, ny = columns or (side, ceil(count / (side * side)))
    x, y = (index.ravel() for index in np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"))
    layer = np.stack([x - nx // 2, y - ny // 2], axis=1).astype(float)
    order = np.argsort((layer**2).sum(axis=1), kind="stable")
    number = np.arange(count)
    height = (number // len(layer))[:, None]
    return np.concatenate([layer[order][number % len(layer)] + 0.25 * (height % 2), height], axis=1) * cell


def instanced(
    model: ImportedModel, count: int, *, fixed: bool, columns: tuple[int, int] | None = None, gap: float | None = None
) -> ImportedModel:
    """A model of one body, `count` times: bodies `0`, `1`, …, each a root of its own.

    Args:
        columns: of a layer along x and y.
        gap: free space [m] between the boxes around neighbours; a tenth of the largest edge where not given.
    """
    body, kind = model.bodies[0], BodyKind.STATIC if fixed else BodyKind.FREE
    meshes = {mesh.name: mesh for mesh in model.meshes}
    solid = [g for g in model.geoms if not isinstance(g.shape, Plane | HeightFieldShape)]
    boxes = [
        shape_bounds(g.shape, P.pose(g.position, g.quaternion), meshes)
        for g in [g for g in solid if g.collides] or solid
    ]
    size = np.max([high for _, high in boxes], axis=0) - np.min([low for low, _ in boxes], axis=0)
    cell = size + (0.1 * size.max() if gap is None else gap)
    places = [split(np.concatenate([place, _AT_ORIGIN[3:]]))[0] for place in grid(count, cell, columns)]
    local = lambda name, i: f"{i}.{name}" if name else str(i)  # noqa: E731
    return replace(
        model,
        bodies=tuple(replace(body, name=str(i), kind=kind, position=place) for i, place in enumerate(places)),
        geoms=tuple(replace(g, name=local(g.name, i), body=i) for i in range(count) for g in model.geoms),
        geom_links=tuple(name for _ in range(count) for name in model.geom_links),
        sites=tuple(replace(s, name=local(s.name, i), body=i) for i in range(count) for s in model.sites),
        links={str(i): i for i in range(count)},
    )

"""Compilation of the declared objects: how many of each there can be, and what each can be.

An object of one source is one entity of its own name. Where it can be several things, each is an entity `mug~0`,
`mug~1`, …, and a slot says that they are one object; where it has a count there are `cube_0`, `cube_1`, … of it. An
instancer is one entity of many equal bodies.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from math import ceil
from pathlib import Path

import numpy as np

from anysim.assets.model import ImportedModel, ImportNote
from anysim.compile.builder import WorldBuilder
from anysim.compile.object import object_model, place_model
from anysim.compile.variants import INSTANCER, KeyedSource, Options, counts, instances, sizes, sources
from anysim.conventions import Array
from anysim.errors import AssetError, Issues, listing
from anysim.geometry.bounds import shape_bounds
from anysim.math import pose as P
from anysim.model.hash import split
from anysim.model.world import BodyKind, HeightFieldShape, Plane, Slot
from anysim_schemas.objects import ObjectSpec

_AT_ORIGIN = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def grid(count: int, cell: Array, columns: tuple[int, int] | None = None) -> Array:
    """Places (count, 3) [m] of equal cells (3,) around the first, which is in the middle of the lowest layer.

    Layer by layer upward, each filled from its middle outward. Every other layer is a quarter of a cell aside, so that
    balls do not stand on each other in columns. Without `columns` (along x and y) the whole is as high as it is wide,
    by number.
    """
    side = max(1, round(count ** (1 / 3)))
    nx, ny = columns or (side, ceil(count / (side * side)))
    layer = _middle_of_layer(count, nx, ny)
    number = np.arange(count)
    height = (number // len(layer))[:, None]
    return np.concatenate([layer[number % len(layer)] + 0.25 * (height % 2), height], axis=1) * cell


def _middle_of_layer(count: int, nx: int, ny: int) -> Array:
    """The `count` columns (≤ count, 2) nearest the middle of a layer of nx by ny, nearest first; all if it has fewer.

    Time and memory are those of `count`, whatever the layer has: only a square around the middle is looked at, and it
    grows until the circle within holds enough.
    """
    half = 1
    while True:
        x, y = (np.arange(max(-(n // 2), -half), min(n - n // 2 - 1, half) + 1) for n in (nx, ny))
        square = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2).astype(float)
        away = (square**2).sum(axis=1)
        if len(square) == nx * ny or (away <= half**2).sum() >= count:
            return square[np.argsort(away, kind="stable")[:count]]
        half *= 2


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


MAX_FORMS = 1024
"""An object that can be more things than this is refused: each of them is built."""


def check_names(objects: Mapping[str, ObjectSpec], robots: Mapping[str, object], issues: Issues) -> None:
    """Names that a count makes must be free; `issues` is at the path of the objects."""
    for name, spec in objects.items():
        made = instances(name, spec)
        taken = [one for one in made if one != name and (one in objects or one in robots)]
        if taken:
            issues.add(
                f"{name}.count",
                f"the {len(made)} instances of '{name}' are called {listing(made, 4)}, but {listing(taken)} "
                f"{'is' if len(taken) == 1 else 'are'} declared as well; rename one of them",
            )


def add_population(
    builder: WorldBuilder, name: str, spec: ObjectSpec, issues: Issues, *, base: Path | None
) -> tuple[list[ImportNote], list[Slot]]:
    """Add all that a declared object can be; what is wrong goes to `issues`, whose path is that of the object.

    Returns:
        Notes of the importers, and the slots of what is not the same in every env.
    """
    try:
        origins, nominal = sources(spec, base)
    except AssetError as error:
        issues.asset("source", error)
        return [], []
    scales = sizes(spec)
    if len(origins) * len(scales.values) > MAX_FORMS:
        issues.add(
            "source",
            f"{len(origins)} sources in {len(scales.values)} sizes are {len(origins) * len(scales.values)} "
            f"things to build, more than {MAX_FORMS}; narrow the folder's pattern, or give fewer `sizes`",
        )
        return [], []
    forms = list(product(origins, scales.values))
    models = [object_model(name, spec, origin, size, issues, base, builder.visual_error) for origin, size in forms]
    whole = [_whole(spec, model) for model in models if model is not None]
    if len(whole) < len(forms):
        return [], []
    first = nominal * len(scales.values) + scales.nominal
    slots = _add(builder, name, spec, [origin for origin, _ in forms], whole, first)
    return [note for model in whole for note in model.report], slots


def _whole(spec: ObjectSpec, model: ImportedModel) -> ImportedModel:
    if spec.family != INSTANCER:
        return model
    assert isinstance(spec.count, int)  # the spec sees to it
    return instanced(model, spec.count, fixed=spec.fixed, columns=spec.grid, gap=spec.gap)


def _add(
    builder: WorldBuilder,
    name: str,
    spec: ObjectSpec,
    origins: list[KeyedSource],
    models: list[ImportedModel],
    first: int,
) -> list[Slot]:
    """The entities of all instances. `first` is the model that is there nominally."""
    names = instances(name, spec)
    number = Options((1,)) if spec.count is None or spec.family == INSTANCER else counts(spec.count)
    there = number.values[number.nominal]
    slots: list[Slot] = []
    for i, one in enumerate(names):
        made: list[int] = []
        for k, (origin, model) in enumerate(zip(origins, models, strict=True)):
            made.append(len(builder.entities))
            place_model(
                builder,
                one if len(models) == 1 else f"{one}~{k}",
                spec,
                origin.source,
                model,
                category=name,
                instance=i,
                family=INSTANCER if spec.family == INSTANCER else "",
            )
        if len(made) > 1 or number.drawn is not None:
            rest = [entity for entity in made if entity != made[first]]
            slots.append(Slot(one, name, i, (made[first], *rest), i < there))
    return slots

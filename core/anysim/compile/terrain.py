"""Compilation of the ground of a spec. Generated ground comes from a builder of the kind `terrains`."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from anysim import registry
from anysim.assets.ground_files import heights_of_mesh, read_heights, read_mesh
from anysim.assets.meshes import FORMATS
from anysim.assets.uri import locate
from anysim.compile.builder import WorldBuilder
from anysim.conventions import GROUND, WORLD, Array
from anysim.errors import AssetError, Issues, PluginError
from anysim.model.appearance import Rgb, nominal_rgb
from anysim.model.world import (
    ORIGIN,
    Compliance,
    Geom,
    HeightField,
    HeightFieldShape,
    MeshShape,
    Plane,
    Shape,
    Surface,
    Tile,
    Vec3,
)
from anysim_schemas.terrain import GENERATED, TerrainSpec

BUILDER = "generated"
"""The name of the entry point of the group `anysim.terrains` that makes pieces of the kinds `GENERATED`, and tiles."""

FIELD_SOFTNESS = 0.01
"""[s] of height fields: a ball foot that touches several of their prisms at once trips over contacts of twice that."""

_GREY: Rgb = (0.45, 0.47, 0.5)


class GeneratedGround(NamedTuple):
    """Heights (rows, cols) [m] over `size` [m], the first row at the lowest y; where their middle is; their tiles.

    They lie so that the platform that robots start on is at the world's origin; of tiles, that of row 0 and column 0.
    """

    heights: Array
    size: tuple[float, float]
    middle: Vec3
    tiles: tuple[Tile, ...] = ()


TerrainBuilder = Callable[[TerrainSpec, Issues], GeneratedGround | None]
"""The ground of a spec; None, with the reasons in the issues, where its parameters do not fit."""


def add_terrain(builder: WorldBuilder, spec: TerrainSpec, issues: Issues, base: Path | None = None) -> None:
    """The ground as a geom of the world; what is wrong goes to `issues`, whose path is that of the terrain."""
    try:
        if spec.kind == "plane":
            _add(builder, spec, Plane(), issues)
        elif spec.kind == "trimesh":
            assert spec.file is not None  # the spec has been checked
            mesh = read_mesh(locate(spec.file, base=base).path, spec.scale or 1.0)
            _add(builder, spec, MeshShape(builder.add_mesh(mesh), concave=True), issues)
        elif spec.kind == "tiles" or spec.kind in GENERATED:
            _add_generated(builder, spec, issues)
        elif spec.kind == "heightfield":
            _add_given(builder, spec, issues, base)
    except AssetError as error:
        issues.asset("file", error)


def _add_generated(builder: WorldBuilder, spec: TerrainSpec, issues: Issues) -> None:
    try:
        build: TerrainBuilder = registry.load("terrains", BUILDER)
    except PluginError as error:
        issues.add("kind", str(error))
        return
    with registry.using("terrains", BUILDER):
        made = build(spec, issues)
    if made is not None:
        _add_field(builder, spec, made.heights, made.size, made.middle, issues)
        builder.tiles = made.tiles


def _add_given(builder: WorldBuilder, spec: TerrainSpec, issues: Issues, base: Path | None) -> None:
    """Heights as they are written, or as a file has them."""
    size, position = spec.size, ORIGIN
    if spec.file is None:
        heights = np.array(spec.heights, dtype=np.float64)
    else:
        path = locate(spec.file, base=base).path
        if path.suffix.lower() in FORMATS:
            heights, size, middle = heights_of_mesh(read_mesh(path, spec.scale or 1.0), spec.cell)
            position = (*middle, 0.0)
        else:
            heights = read_heights(path, spec.height_range)
    _add_field(builder, spec, heights, size, position, issues)


def _add_field(
    builder: WorldBuilder, spec: TerrainSpec, heights: Array, size: tuple[float, float], position: Vec3, issues: Issues
) -> None:
    heights.setflags(write=False)
    builder.add_heightfields([HeightField(GROUND, heights, size)])
    _add(builder, spec, HeightFieldShape(GROUND), issues, position)


def _add(builder: WorldBuilder, spec: TerrainSpec, shape: Shape, issues: Issues, position: Vec3 = ORIGIN) -> None:
    softness = FIELD_SOFTNESS if isinstance(shape, HeightFieldShape) else 0.0
    gives_way = Compliance(margin=spec.margin) if spec.margin else None
    touch = Surface(friction=spec.friction, restitution=spec.restitution, softness=softness, compliance=gives_way)
    color = (*nominal_rgb(spec.color, _GREY, issues), 1.0)
    builder.geoms.append(Geom(GROUND, WORLD, shape, position, color=color, surface=touch))

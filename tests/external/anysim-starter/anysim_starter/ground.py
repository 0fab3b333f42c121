"""Builders of surroundings: waves for every generated ground, and rooms that are a floor."""

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.compile.room import ROOM, RoomThing
from anysim.compile.terrain import GeneratedGround
from anysim.conventions import IDENTITY_QUATERNION
from anysim.errors import Issues
from anysim.model.world import ORIGIN, Body, BodyKind, Box, Geom
from anysim_schemas.rooms import RoomSpec, furniture_names
from anysim_schemas.terrain import TerrainSpec


def waves(spec: TerrainSpec, issues: Issues) -> GeneratedGround | None:
    """Waves along x of 2 m and up to 0.1 m of height, whatever kind is asked for; no tiles."""
    if spec.kind == "tiles":
        issues.add("kind", "this builder makes no tiles; ask for one piece")
        return None
    x = np.linspace(-spec.size[0] / 2, spec.size[0] / 2, round(spec.size[0] / spec.cell) + 1)
    height = 0.05 * (1.0 - np.cos(np.pi * x)) * (0.5 if spec.difficulty is None else spec.difficulty)
    heights = np.tile(height, (round(spec.size[1] / spec.cell) + 1, 1))
    return GeneratedGround(heights, spec.size, ORIGIN)


def bare(spec: RoomSpec, issues: Issues) -> list[RoomThing]:
    """A floor of the size of the room, without walls; no furniture."""
    if spec.plan is not None or furniture_names(spec):
        issues.add("style", "these rooms are bare rectangles: give a size alone, no plan and no furniture")
        return []
    width, depth = spec.size or (5.0, 4.0)
    half = (width / 2, depth / 2, 0.03)
    floor = Geom("floor", 0, Box(half), (0.0, 0.0, -0.03), color=(0.6, 0.5, 0.4, 1.0), collides=False)
    shell = ImportedModel(ROOM, (Body("", BodyKind.STATIC),), geoms=(floor,))
    return [RoomThing(ROOM, "room", shell, ORIGIN, IDENTITY_QUATERNION)]

"""The ground of a spec into a World under construction."""

import numpy as np

from anysim.conventions import GROUND, WORLD
from anysim.world.builder import WorldBuilder
from anysim.world.model import Geom, HeightField, HeightFieldShape, Plane, Surface
from anysim_schemas.terrain import TerrainSpec


def add_terrain(builder: WorldBuilder, spec: TerrainSpec) -> None:
    """The ground as a geom of the world."""
    touch = Surface(friction=spec.friction, restitution=spec.restitution)
    color = (*spec.color, 1.0)
    if spec.kind == "plane":
        builder.geoms.append(Geom(GROUND, WORLD, Plane(), color=color, surface=touch))
    elif spec.heights is not None:
        heights = np.array(spec.heights, dtype=np.float64)
        heights.setflags(write=False)
        builder.add_heightfields([HeightField(GROUND, heights, spec.size)])
        builder.geoms.append(Geom(GROUND, WORLD, HeightFieldShape(GROUND), color=color, surface=touch))

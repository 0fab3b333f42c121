"""Which geoms of a World can meet, and the PhysX shapes that make them meet by the rules. Knows no SAPIEN."""

from dataclasses import replace

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.errors import EngineError
from anysim.world.model import World
from anysim_sapien.exclusions import Apart, apart_of
from anysim_sapien.layout import Layout
from anysim_sapien.surfaces import Copy, copies_of


class Meeting:
    """Pairs of the geoms that collide.

    Attributes:
        apart: how excluded pairs are kept apart.
        solid: (C,) the World's geoms that collide.
    """

    def __init__(self, world: World, layout: Layout) -> None:
        self.apart: Apart = apart_of(world)
        self.solid = np.array([i for i, geom in enumerate(world.geoms) if geom.collides], dtype=int)
        self._surfaces = [world.geoms[i].surface for i in self.solid]
        self._labels = [self.apart.labels.get(world.geoms[i].body, 0) for i in self.solid]
        self._fixed = layout.geom_fixed[self.solid]
        self._meet = self._may_meet(world)

    def _may_meet(self, world: World) -> Array:
        """(C, C) bool: which of the geoms that collide can ever touch."""
        bodies = [world.geoms[i].body for i in self.solid]
        parents = [world.bodies[b].parent if b != WORLD else WORLD for b in bodies]
        excluded = {pair for low, high in world.excluded_pairs for pair in ((low, high), (high, low))}
        meet = np.zeros((len(bodies), len(bodies)), dtype=bool)
        for i, first in enumerate(bodies):
            for k, second in enumerate(bodies):
                kin = first == second or (second != WORLD and parents[i] == second)
                kin = kin or (first != WORLD and parents[k] == first)
                both_fixed = self._fixed[i] and self._fixed[k]
                meet[i, k] = not (kin or both_fixed or (first, second) in excluded)
        return meet

    def copies(self, friction: Array, restitution: Array | None = None) -> dict[int, list[Copy]]:
        """The shapes of each geom that collides, for the coefficients in force (G,); restitutions as built for None.

        Raises:
            EngineError: more different pairs than PhysX has collision groups.
        """
        surfaces = self._surfaces
        if restitution is not None:
            pairs = zip(surfaces, restitution[self.solid].tolist(), strict=True)
            surfaces = [replace(surface, restitution=value) for surface, value in pairs]
        made = copies_of(
            surfaces, friction[self.solid], self._fixed, self._meet, self._labels, self.apart.between
        )  # fmt: skip
        return dict(zip(self.solid.tolist(), made, strict=True))


def refusals(world: World) -> list[str]:
    """Why PhysX' filters cannot tell this World's pairs apart, if so."""
    try:
        Meeting(world, Layout.of(world)).copies(np.array([geom.surface.friction for geom in world.geoms], dtype=float))
    except EngineError as error:
        return [str(error)]
    return []

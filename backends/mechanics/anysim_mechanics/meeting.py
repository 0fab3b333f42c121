"""The geoms of a World that can meet, and the shapes that make them meet by the rules."""

from dataclasses import replace
from itertools import product
from math import prod

import numpy as np

from anysim.conventions import Array
from anysim.errors import EngineError
from anysim.model.pairs import may_meet
from anysim.model.world import World
from anysim_mechanics.collision_groups import Copy, copies_of
from anysim_mechanics.exclusion_groups import Apart, apart_of
from anysim_mechanics.layout import Layout

MOST = 64
"""Ways to fill the slots of a World that are tried before it is refused."""


class Meeting:
    """Pairs of the geoms that collide and are there.

    Attributes:
        apart: how excluded pairs are kept apart.
        solid: (C,) the World's geoms that collide and are there.
    """

    def __init__(self, world: World, layout: Layout) -> None:
        self.apart: Apart = apart_of(world, layout.there)
        here = [*layout.there.tolist(), True]  # the last one is the world's own
        self.solid = np.array([i for i, geom in enumerate(world.geoms) if geom.collides and here[geom.body]], dtype=int)
        self._surfaces = [world.geoms[i].surface for i in self.solid]
        self._labels = [self.apart.labels.get(world.geoms[i].body, 0) for i in self.solid]
        bodies = np.array([world.geoms[i].body for i in self.solid], dtype=int)
        self._fixed = np.append(layout.fixed, True)[bodies]
        self._meet = may_meet(world, bodies)

    def copies(self, friction: Array, restitution: Array | None = None) -> dict[int, list[Copy]]:
        """The shapes of each geom that collides, for the coefficients in force (G,); restitutions as built for None.

        Raises:
            EngineError: more different pairs than there are collision groups.
        """
        surfaces = self._surfaces
        if restitution is not None:
            pairs = zip(surfaces, restitution[self.solid].tolist(), strict=True)
            surfaces = [replace(surface, restitution=value) for surface, value in pairs]
        made = copies_of(surfaces, friction[self.solid], self._fixed, self._meet, self._labels, self.apart.between)
        return dict(zip(self.solid.tolist(), made, strict=True))


def refusals(world: World) -> list[str]:
    """Why collision groups cannot tell this World's pairs apart, if so."""
    friction = np.array([geom.surface.friction for geom in world.geoms], dtype=float)
    together = _trouble(world, friction, np.ones(len(world.entities), dtype=bool))
    if not together or not world.slots:
        return together
    # what can be there at once may do where all of it together does not
    fullest = prod(len(slot.entities) for slot in world.slots)
    if fullest > MOST:
        return [f"its {fullest} combinations of entities are too many to try one by one, and together {together[0]}"]
    fixed = np.array(world.initial_presence)
    fixed[[entity for slot in world.slots for entity in slot.entities]] = False
    for chosen in product(*(slot.entities for slot in world.slots)):
        present = fixed.copy()
        present[list(chosen)] = True
        if trouble := _trouble(world, friction, present):
            return trouble
    return []


def _trouble(world: World, friction: Array, present: Array) -> list[str]:
    try:
        Meeting(world, Layout.of(world, present[list(world.body_entity)])).copies(friction)
    except EngineError as error:
        return [str(error)]
    return []

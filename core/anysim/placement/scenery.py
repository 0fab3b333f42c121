"""What is around whoever is being placed: things at their places, surfaces, the ground, and regions by name."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from anysim.conventions import WORLD
from anysim.geometry import polygon as G
from anysim.geometry.bounds import ground_top
from anysim.geometry.convex_parts import IDENTITY, Placed, Solid, Vec
from anysim.model.world import Plane, World
from anysim.placement.order import Item, items_of, meant
from anysim.placement.resting_poses import RestingPose, resting_poses
from anysim.placement.support_surfaces import SupportSurface, surfaces
from anysim_schemas.layout import PlaceFields
from anysim_schemas.regions import RegionSpec


class Scenery:
    """What all envs of a World have in common: the shapes of things, made when they are first asked for."""

    def __init__(self, world: World, regions: Mapping[str, RegionSpec]) -> None:
        self.world, self.regions = world, regions
        self.items = items_of(world)
        self._solids: dict[str, Solid] = {}
        self._surfaces: dict[str, tuple[SupportSurface, ...]] = {}
        self._resting: dict[str, tuple[RestingPose, ...]] = {}
        self._by_name = {entity.name: entity for entity in world.entities}

    def solid(self, name: str) -> Solid:
        """An entity's shape."""
        if name not in self._solids:
            self._solids[name] = Solid(self.world, self._by_name[name])
        return self._solids[name]

    def surfaces_of(self, placed: Placed) -> Sequence[SupportSurface]:
        """The surfaces of a placed thing, in its root's frame less its heading where it stands upright."""
        rotation = placed.pose.rotation
        if rotation[2][2] > 1.0 - 1e-9:
            if placed.name not in self._surfaces:
                self._surfaces[placed.name] = surfaces(self.world, self.solid(placed.name), IDENTITY)
            return self._surfaces[placed.name]
        return surfaces(self.world, self.solid(placed.name), rotation)

    def resting(self, name: str) -> tuple[RestingPose, ...]:
        """The stable poses of an entity."""
        if name not in self._resting:
            self._resting[name] = resting_poses(self.world, self.solid(name))
        return self._resting[name]

    @cached_property
    def level(self) -> float | None:
        """The height of the ground where it is a plane, or nothing; None where it must be looked up."""
        own = [g for g in self.world.geoms if g.body == WORLD]
        if all(isinstance(g.shape, Plane) for g in own):
            return max((g.position[2] for g in own), default=0.0)
        return None


@dataclass
class View:
    """The surroundings in one env, as seen by one who is being placed: `Around` of `anysim.placement.candidate`.

    `placed` has things by the names of their items, `places` what was said of them; `present` says which items are
    there at all.
    """

    scenery: Scenery
    placed: dict[str, Placed] = field(default_factory=dict)
    places: dict[str, PlaceFields] = field(default_factory=dict)
    origin: Vec = (0.0, 0.0, 0.0)
    present: Callable[[Item], bool] = lambda item: True
    by: Item | None = None

    def item(self, name: str) -> Item | None:
        """Who is meant by a name."""
        return next((item for item in meant(name, self.scenery.items, self.by) if self.present(item)), None)

    def find(self, name: str) -> Placed | None:
        """A placed thing by name; None where it is not there."""
        found = self.item(name)
        return None if found is None else self.placed.get(found.name)

    def surfaces_of(self, placed: Placed) -> Sequence[SupportSurface]:
        return self.scenery.surfaces_of(placed)

    def ground(self, low: G.Point, high: G.Point) -> float:
        """The greatest height of the ground under a rectangle [m]."""
        if self.scenery.level is not None:
            return self.scenery.level
        return float(ground_top(self.scenery.world, np.array(low), np.array(high)))

    def support_of(self, name: str) -> tuple[str, bool] | None:
        """What a thing rests on, and whether inside of it."""
        found = self.item(name)
        place = None if found is None else self.places.get(found.name)
        if place is None or place.position is not None:
            return None
        if place.in_ is not None:
            return place.in_, True
        if place.on is not None or place.under is not None:
            return place.on or "terrain", False
        return None

    def region(self, name: str) -> RegionSpec:
        return self.scenery.regions[name]

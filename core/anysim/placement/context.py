"""The context of a placement: the shapes of a World, and in one env what has its place already."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from typing import NamedTuple, Self

import numpy as np

from anysim.conventions import GROUND, WORLD
from anysim.geometry import polygon as G
from anysim.geometry.bounds import ground_top
from anysim.geometry.convex_parts import IDENTITY, PlacedSolid, Solid, Vec, pose_of
from anysim.model.world import Plane, Slot, World
from anysim.placement.order import items_of, meant
from anysim.placement.resting_poses import RestingPose, resting_poses
from anysim.placement.support_surfaces import SupportSurface, surfaces
from anysim_schemas.layout import PlaceFields
from anysim_schemas.regions import RegionSpec


class SettledObject(NamedTuple):
    """Something that has its place: its shape there, whether it is welded to the world, and whether nothing was drawn.

    `listed` says that the layout has put it there: clearances are kept to such things.
    """

    placed: PlacedSolid
    fixed: bool = False
    constant: bool = True
    collides: bool = True
    listed: bool = False


class Impossible(NamedTuple):
    """Why there is no candidate. `hopeless` where no draw would help."""

    reason: str
    hopeless: bool = False


class PlacementContext:
    """Shapes, surfaces and regions of a World, and the things that have their place in one env of it.

    Shapes are made when they are first asked for, once for all contexts that come from one another (`in_env`).

    Attributes:
        items: the logical objects and robots of the World.
        origin: that of the env, in the world [m].
        settled: what has its place, by the names of the items.
        places: what was said of the places, by the names of the items.
        present: whether an item is there.
        by: the item that is being placed; a category stands for its instance of the same number.
    """

    def __init__(self, world: World, regions: Mapping[str, RegionSpec] | None = None) -> None:
        self.world, self._regions = world, regions or {}
        self.items = items_of(world)
        self.origin: Vec = (0.0, 0.0, 0.0)
        self.settled: dict[str, SettledObject] = {}
        self.places: dict[str, PlaceFields] = {}
        self.by: Slot | None = None
        self.present: Callable[[Slot], bool] = lambda item: True
        self._solids: dict[str, Solid] = {}
        self._surfaces: dict[str, tuple[SupportSurface, ...]] = {}
        self._resting: dict[str, tuple[RestingPose, ...]] = {}
        self._by_name = {entity.name: entity for entity in world.entities}
        own = [g for g in world.geoms if g.body == WORLD]
        level = all(isinstance(g.shape, Plane) for g in own)
        self._level = max((g.position[2] for g in own), default=0.0) if level else None

    def in_env(self, origin: Vec, present: Callable[[Slot], bool], settled: Mapping[str, SettledObject]) -> Self:
        """The context of an env: where it is, which items are there, and what has its place and keeps it."""
        own = copy(self)
        own.origin, own.present, own.settled, own.places, own.by = origin, present, dict(settled), {}, None
        return own

    # ------------------------------------------------------------------ shapes, the same in every env

    def solid(self, name: str) -> Solid:
        """An entity's shape."""
        if name not in self._solids:
            self._solids[name] = Solid(self.world, self._by_name[name])
        return self._solids[name]

    def initial(self, name: str) -> PlacedSolid:
        """An entity at its initial pose."""
        body = self.world.bodies[self._by_name[name].root]
        return self.solid(name).at(pose_of((*body.position, *body.quaternion)))

    def surfaces_of(self, placed: PlacedSolid) -> Sequence[SupportSurface]:
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

    def ground(self, low: G.Point, high: G.Point) -> float:
        """The greatest height of the ground under a rectangle [m]."""
        if self._level is not None:
            return self._level
        return float(ground_top(self.world, np.array(low), np.array(high)))

    def region(self, name: str) -> RegionSpec:
        """A region by name."""
        return self._regions[name]

    # ------------------------------------------------------------------ things at their places

    def item(self, name: str) -> Slot | None:
        """The item that a name means here; None where there is none in this env."""
        return next((item for item in meant(name, self.items, self.by) if self.present(item)), None)

    def find(self, name: str) -> PlacedSolid | None:
        """A placed thing by name; None where it is not there."""
        item = self.item(name)
        found = None if item is None else self.settled.get(item.name)
        return None if found is None else found.placed

    def support_of(self, name: str) -> tuple[str, bool] | None:
        """What a placed thing rests on, and whether inside of it; None where its position was given."""
        found = self.item(name)
        place = None if found is None else self.places.get(found.name)
        if place is None or place.position is not None:
            return None
        if place.in_ is not None:
            return place.in_, True
        if place.on is not None or place.under is not None:
            return place.on or GROUND, False
        return None

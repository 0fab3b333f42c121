"""Constraints on a candidate: everything that its entry says, and the room of everything else."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from anysim.geometry import polygon as G
from anysim.geometry.convex_parts import PlacedSolid, Solid
from anysim.model.world import Slot
from anysim.placement.candidate import Candidate
from anysim.placement.clearance import TOUCH, ClearanceQuery
from anysim.placement.context import PlacementContext
from anysim.placement.order import meant
from anysim.placement.relations import extent, side_direction, sideways
from anysim_schemas.layout import PlaceFields
from anysim_schemas.proposals import ProposedPose
from anysim_schemas.relations import SIDES, SideSpec

EXACT = 1e-6
"""[m] of rounding that a distance is allowed."""


class Objection(NamedTuple):
    """What is wrong with a candidate, in words that follow 'it', and the name of what is in the way.

    With `absent` there is no candidate, and the words are a sentence of their own.
    """

    reason: str
    blocker: str | None = None
    absent: bool = False


@dataclass
class PlacementTask:
    """Something to be placed: what is there of an item, and what was said of its place."""

    item: Slot
    solid: Solid
    place: PlaceFields
    path: str
    constant: bool
    """Nothing is drawn for its place."""
    proposed: ProposedPose | None = None
    """A proposed pose; nothing else is tried then."""
    tick: int = 0


@dataclass
class Constraints:
    """Checks of candidates in one env."""

    context: PlacementContext
    clearance: ClearanceQuery
    _supports: dict[str, set[str]] = field(default_factory=dict)

    def objection(self, task: PlacementTask, found: Candidate) -> Objection | None:
        """Why a candidate cannot stay; None where it can."""
        place = task.place
        x, y, _ = found.pose.position
        if (
            found.area is not None
            and found.drawn_from not in ("area", "origin")
            and not G.holds(found.area, x, y, EXACT)
        ):
            edge = "" if found.support is None else "would stick out over the edge, or "
            return Objection(f"{edge}is outside of its region")
        for side in SIDES:
            relation = getattr(place, side)
            if relation is not None and side != found.drawn_from:
                wrong = _beside(side, relation, found.placed, self.context)
                if wrong is not None:
                    return wrong
        if place.checked:
            wrong = self._crowding(task, found)
            if wrong is not None:
                return wrong
        if place.near is not None:
            other = self.context.find(place.near.of)
            if other is not None:
                low, high = place.near.distance
                gap = self.clearance.gap(found.placed, other, high + EXACT)
                if not low - EXACT <= gap <= high + EXACT:
                    how = "nearer to" if gap < low else "farther from"
                    return Objection(f"is {how} '{place.near.of}' than {low if gap < low else high:g} m")
        return None

    def _crowding(self, task: PlacementTask, found: Candidate) -> Objection | None:
        item, solid, place, constant, context = task.item, task.solid, task.place, task.constant, self.context
        if solid.collides and not (solid.fixed and constant):
            if not self.clearance.above_ground(found.placed):
                return Objection("would be below the ground")
            walls = self.clearance.walls
            if walls is not None and self.clearance.gap(found.placed, walls, 0.0) < -TOUCH:
                return Objection("would be inside of the terrain")
        clear_of = _clear_of(place, context) if place.clear_of else {}
        for name, other in context.settled.items():
            if name == item.name or (solid.fixed and other.fixed and constant and other.constant):
                continue
            wanted = clear_of.get(name, 0.0)
            if other.listed:  # clearances hold both ways, but not against what something rests on
                theirs = context.places[name]
                wanted = max(wanted, _clear_of(theirs, context).get(item.name, 0.0) if theirs.clear_of else 0.0)
                asked = max(place.clearance, theirs.clearance)
                if asked > wanted and not self._stacked(item.name, name):
                    wanted = asked
            if wanted <= 0 and not (solid.collides and other.collides):
                continue
            gap = self.clearance.gap(found.placed, other.placed, wanted)
            if gap < (wanted - EXACT if wanted > 0 else -TOUCH):
                if wanted > 0:
                    return Objection(f"cannot keep its clearance of {wanted:g} m from '{name}'", name)
                return Objection(f"would be inside of '{name}'", name)
        return None

    def _stacked(self, one: str, other: str) -> bool:
        """Whether one of two things rests on the other, or on what does."""
        for name in (one, other):
            if name not in self._supports:
                self._supports[name] = _below(self.context.places[name], self.context)
        return other in self._supports[one] or one in self._supports[other]


def _clear_of(place: PlaceFields, context: PlacementContext) -> Mapping[str, float]:
    """Distances by the names of items: a category stands for all of its instances."""
    return {item.name: distance for name, distance in place.clear_of.items() for item in meant(name, context.items)}


def _below(place: PlaceFields, context: PlacementContext) -> set[str]:
    """What it rests on or under, and what that rests on, and so on: no clearance is kept to these."""
    found: set[str] = set()
    waiting = [name for name in (place.on, place.in_, place.under) if name is not None]
    for relation in (place.near, *(getattr(place, side) for side in SIDES)):
        support = None if relation is None else context.support_of(relation.of)
        if support is not None and not waiting:
            waiting.append(support[0])
    while waiting:
        item = context.item(waiting.pop().partition(".")[0])
        if item is not None and item.name not in found:
            found.add(item.name)
            support = context.support_of(item.name)
            waiting += [] if support is None else [support[0]]
    return found


def _beside(side: str, relation: SideSpec, placed: PlacedSolid, context: PlacementContext) -> Objection | None:
    other = context.find(relation.of)
    if other is None:
        return None
    n = side_direction(side, relation, other)
    gap = -extent(placed, (-n[0], -n[1], 0.0)) - extent(other, n)
    middle, free = sideways(relation, other, n)
    across = (-n[1], n[0], 0.0)
    own = 0.5 * (extent(placed, across) - extent(placed, (n[1], -n[0], 0.0)))
    low, high = relation.distance
    words = side.replace("_", " ")
    if gap < low - EXACT or gap > high + EXACT:
        return Objection(f"is not {low:g} to {high:g} m {words} '{relation.of}'")
    if abs(own - middle) > free + EXACT:
        return Objection(f"is {words} '{relation.of}', but too far to the side")
    return None

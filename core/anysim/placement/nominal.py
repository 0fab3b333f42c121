"""Nominal places: the layout with the middle of its ranges, each thing where its supports are."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from anysim.conventions import GROUND, Array
from anysim.errors import Issues
from anysim.geometry.bounds import EntityShape
from anysim.geometry.convex_parts import row_of
from anysim.math import pose as P
from anysim.model.hash import split
from anysim.model.slots import is_robot
from anysim.model.world import BodyKind, Slot, World
from anysim.placement.candidate import candidate
from anysim.placement.context import Impossible, PlacementContext, SettledObject
from anysim.placement.order import entry_of, placement_order
from anysim.placement.sampler import NominalSampler
from anysim_schemas.layout import PlaceFields, PlacementSpec
from anysim_schemas.regions import RegionSpec


def nominal_place(entry: PlacementSpec) -> PlaceFields:
    """The place that counts where nothing is drawn: that of the episodes which a ratio leaves out, else the first."""
    if entry.otherwise is not None:
        return entry.otherwise
    return entry.chosen(0) if entry.any_of else entry


def place_nominally(
    world: World,
    layout: Mapping[str, PlacementSpec],
    order: Sequence[str],
    issues: Issues | None = None,
    regions: Mapping[str, RegionSpec] | None = None,
) -> World:
    """The World with its objects where the layout has them nominally.

    An object without an entry that moves freely is set onto the ground at the origin (several of a category in a row
    from there, along x), a fixed one with its frame there.
    What an entry asks for that no draw can give goes to `issues`, whose path is that of the layout.
    """
    context = PlacementContext(world, regions)
    items = {item.name: item for item in context.items}
    names, _ = placement_order(layout, tuple(items.values()))
    entries = {name: entry_of(layout, items[name]) for name in items}
    for item in items.values():
        context.settled[item.name] = SettledObject(context.initial(world.entities[item.entities[0]].name))
    loose = [
        item.name
        for item in items.values()
        if entries[item.name] is None
        and not is_robot(world, item)
        and world.bodies[world.entities[item.entities[0]].root].kind is BodyKind.FREE
    ]
    rows: dict[int, Array] = {}
    count: dict[str, int] = {}
    for name in [*(n for n in names if entries.get(n) in order), *loose]:
        entry = entries[name]
        spec = _in_a_row(world, items[name]) if entry is None else layout[entry]
        place, context.by = nominal_place(spec), items[name]
        context.places[name] = place
        number = count[entry or ""] = count.get(entry or "", -1) + 1
        for entity in reversed(items[name].entities):  # the first one is what the others see
            solid = context.solid(world.entities[entity].name)
            found = candidate(solid, place, NominalSampler(number), context)
            if not isinstance(found, Impossible):
                context.settled[name] = SettledObject(found.placed)
                rows[entity] = row_of(found.pose, found.quaternion)
            elif found.hopeless and issues is not None and number == 0:
                issues.add(str(entry), f"'{name}' cannot be placed: {found.reason}")
    bodies = list(world.bodies)
    for entity, row in rows.items():
        position, quaternion = split(row)
        for body, pose in roots_at(world, entity, row, position, quaternion):
            bodies[body] = replace(bodies[body], position=pose[0], quaternion=pose[1])
    return replace(world, bodies=tuple(bodies))


def roots_at(
    world: World, entity: int, row: Array, position: Any, quaternion: Any
) -> list[tuple[int, tuple[Any, Any]]]:
    """The pose of each body of an entity that hangs on no other, its first one at `row` (7,)."""
    found = world.entities[entity]
    roots = [(found.root, (position, quaternion))]
    first = P.inverse(P.pose(world.bodies[found.root].position, world.bodies[found.root].quaternion))
    for body in range(found.body_start + 1, found.body_stop):
        own = world.bodies[body]
        if own.kind is not BodyKind.LINK:
            roots.append((body, split(P.compose(row, P.compose(first, P.pose(own.position, own.quaternion))))))
    return roots


def _in_a_row(world: World, item: Slot) -> PlacementSpec:
    """The entry of something free that has none: on the ground, the instances of a category side by side along x."""
    radius = EntityShape(world, world.entities[item.entities[0]].name).radius if item.instance else 0.0
    return PlacementSpec(on=GROUND, x=2.2 * radius * item.instance, y=0.0)

"""Where things are nominally: the layout with the middle of its ranges, each thing where its supports are."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from anysim.conventions import GROUND, Array
from anysim.errors import listing, suggest
from anysim.geometry.bounds import EntityShape
from anysim.geometry.convex_parts import Placed, pose_of, row_of
from anysim.issues import Issues
from anysim.math import pose as P
from anysim.model.rounding import split
from anysim.model.world import BodyKind, World
from anysim.placement.candidate import candidate
from anysim.placement.context import Impossible
from anysim.placement.order import Item, entry_of, items_of, meant, ordered
from anysim.placement.scenery import Scenery, View
from anysim.randomization.distributions import nominal
from anysim_schemas.layout import PlaceFields, PlacementSpec
from anysim_schemas.regions import RegionSpec

SPREAD = (0.8191725133961645, 0.6710436067037893, 0.5497004779019703)
"""Steps of an even sequence in the unit cube (the powers of the inverse of the root of x^4 = x + 1)."""


def _in_a_row(world: World, item: Item) -> PlacementSpec:
    """The entry of something free that has none: on the ground, the instances of a category side by side along x."""
    radius = EntityShape(world, world.entities[item.entities[0]].name).radius if item.instance else 0.0
    return PlacementSpec(on=GROUND, x=2.2 * radius * item.instance, y=0.0)


def placement_order(
    layout: Mapping[str, PlacementSpec], items: Sequence[Item] = ()
) -> tuple[list[str], list[list[str]]]:
    """The entries with what each refers to before it (else as written), and the circles that prevent it.

    With `items`, the names of items instead: all that have an entry. A circle is listed once, as the names along it;
    what is in or on a circle is missing from the order.
    """
    if not items:
        return ordered({name: [other for _, other in references(layout[name])] for name in layout})
    rank = {name: k for k, name in enumerate(layout)}
    own = {item.name: entry for item in items if (entry := entry_of(layout, item)) is not None}
    by_name = {item.name: item for item in items}
    needs = {
        name: [
            other.name
            for _, reference in references(layout[own[name]])
            for other in meant(reference, items, by_name[name])
        ]
        for name in sorted(own, key=lambda name: (rank[own[name]], by_name[name].instance))
    }
    return ordered(needs)


def references(entry: PlacementSpec) -> list[tuple[str, str]]:
    """What an entry depends on, in any of its variants: the dotted key below it, and the name."""
    found = [
        (".".join((*keys, *path)), name)
        for keys, place in entry.variants()
        for path, name in place.references()
        if name != GROUND
    ]
    return list(dict.fromkeys(found))


def check_layout(
    layout: Mapping[str, PlacementSpec],
    objects: Sequence[str],
    robots: Sequence[str],
    issues: Issues,
    fixtures: Sequence[str] = (),
    *,
    instances: Sequence[str] = (),
    regions: Sequence[str] = (),
) -> list[str]:
    """The entries that can be placed, in order; what is wrong goes to `issues`, whose path is that of the layout.

    `instances` are names of single objects where `objects` are categories; `fixtures` have their place and can be
    referred to, as the furniture of a room.
    """
    known_objects = list(dict.fromkeys([*objects, *instances]))
    known = [*known_objects, *robots, *fixtures]
    broken: set[str] = set()
    for name, spec in layout.items():
        at = issues.at(name)
        if name in robots:
            issues.add(name, f"'{name}' is a robot; its place is in world.robots.{name} (position, yaw)")
        elif name not in known_objects:
            issues.add(
                name, f"there is no object '{name}'{suggest(name, known_objects)} (objects: {listing(known_objects)})"
            )
        for key, other in references(spec):
            if other not in known:
                resting = key.rpartition(".")[2] in ("on", "in", "under")
                names = [*known, GROUND] if key.rpartition(".")[2] == "on" else known
                purpose = "to rest on" if resting else "that its place could refer to"
                at.add(
                    key, f"there is no object '{other}' {purpose}{suggest(other, names)} (objects: {listing(names)})"
                )
                broken.add(name)
        for path, place in spec.variants():
            if isinstance(place.region, str) and place.region not in regions:
                at.add(
                    ".".join((*path, "region")),
                    f"there is no region '{place.region}'{suggest(place.region, regions)} "
                    f"(world.regions: {listing(regions) or 'none'})",
                )
                broken.add(name)
            for other in place.clear_of:
                if other not in known:
                    at.add(
                        ".".join((*path, "clear_of", other)),
                        f"there is no object '{other}' to stay clear of{suggest(other, known)} "
                        f"(objects: {listing(known)})",
                    )
    order, circles = placement_order(layout)
    for circle in circles:
        following = [*circle[1:], circle[0]]
        key = next(key for key, other in references(layout[circle[0]]) if other == following[0])
        if all(layout[name].on == other for name, other in zip(circle, following, strict=True)):
            text = f"the objects rest on each other in a circle: {' on '.join([*circle, circle[0]])}"
        else:
            text = f"the places depend on each other in a circle: {' on '.join([*circle, circle[0]])}"
        issues.add(f"{circle[0]}.{key}", text)
    return [name for name in order if name in known_objects and name not in broken]


def spread(number: int, count: int) -> Sequence[float]:
    """The `number`-th of a sequence of points that fill the unit cube evenly, its middle first."""
    return tuple((0.5 + number * step) % 1.0 for step in SPREAD[:count])


class _Middle:
    """The middle of what may be drawn; what goes anywhere on one support is spread over it, one after the other."""

    def __init__(self, number: int) -> None:
        self._number = number

    def value(self, field: str, value: Any) -> Any:
        del field
        return nominal(value)

    def uniform(self, purpose: str, count: int) -> Sequence[float]:
        if purpose == "rest":
            return (0.0,) * count
        return spread(self._number, count)


def nominal_place(entry: PlacementSpec) -> PlaceFields:
    """The place that counts where nothing is drawn: that of the episodes which a ratio leaves out, else the first."""
    if entry.otherwise is not None:
        return entry.otherwise
    return entry.chosen(0) if entry.any_of else entry


def initial_root(world: World, name: str) -> Array:
    """The initial pose (7,) of an entity's root."""
    root = next(e.root for e in world.entities if e.name == name)
    return P.pose(world.bodies[root].position, world.bodies[root].quaternion)


def initially_placed(scenery: Scenery, entity: int) -> Placed:
    """An entity at its initial pose."""
    found = scenery.world.entities[entity]
    body = scenery.world.bodies[found.root]
    return scenery.solid(found.name).at(pose_of((*body.position, *body.quaternion)))


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
    scenery = Scenery(world, regions or {})
    items = {item.name: item for item in items_of(world)}
    names, _ = placement_order(layout, tuple(items.values()))
    entries = {name: entry_of(layout, items[name]) for name in items}
    view = View(scenery)
    for item in items.values():
        view.placed[item.name] = initially_placed(scenery, item.entities[0])
    loose = [
        item.name
        for item in items.values()
        if entries[item.name] is None
        and not item.robot
        and world.bodies[world.entities[item.entities[0]].root].kind is BodyKind.FREE
    ]
    rows: dict[int, Array] = {}
    count: dict[str, int] = {}
    for name in [*(n for n in names if entries[n] in order), *loose]:
        entry = entries[name]
        spec = _in_a_row(world, items[name]) if entry is None else layout[entry]
        place, view.by = nominal_place(spec), items[name]
        view.places[name] = place
        number = count[entry or ""] = count.get(entry or "", -1) + 1
        for entity in reversed(items[name].entities):  # the first one is what the others see
            solid = scenery.solid(world.entities[entity].name)
            found = candidate(solid, place, lambda s=solid: scenery.resting(s.name), _Middle(number), view)
            if not isinstance(found, Impossible):
                view.placed[name] = found.placed
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

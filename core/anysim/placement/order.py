"""The order of a layout: logical objects, each with an entry or none, and what each needs before it.

A logical object is a slot of the World, or an entity that is in none. An entry of the layout is for one of them by
name, or for all of a category; a reference is one of them by name, or of a category, then the one of one's own number.
"""

from collections.abc import Iterable, Mapping, Sequence

from anysim.conventions import GROUND
from anysim.errors import Issues, listing, suggest
from anysim.model.world import Slot, World
from anysim_schemas.layout import PlacementSpec


def items_of(world: World) -> tuple[Slot, ...]:
    """The logical objects and robots of a World, in the order of their first entities."""
    return tuple(sorted(world.logical_objects.values(), key=lambda item: item.entities))


def entry_of(layout: Mapping[str, PlacementSpec], item: Slot) -> str | None:
    """The name of the entry that holds for an item: its own, else that of its category."""
    return next((name for name in (item.name, item.category) if name in layout), None)


def meant(reference: str, items: Iterable[Slot], by: Slot | None = None) -> list[Slot]:
    """The items that a name stands for, the best first: of a category, the instance of the same number."""
    items = tuple(items)
    exact = [item for item in items if item.name == reference]
    if exact:
        return exact
    of_kind = [item for item in items if item.category == reference]
    return sorted(of_kind, key=lambda item: (by is None or item.instance != by.instance, item.instance))


def _ordered(needs: Mapping[str, Sequence[str]]) -> tuple[list[str], list[list[str]]]:
    """Names with what each needs before it (else as given), and the circles that prevent it.

    A circle is listed once, as the names along it; what is in or on a circle is missing from the order.
    """
    order: list[str] = []
    circles: list[list[str]] = []
    state: dict[str, str] = {}

    def visit(name: str, chain: list[str]) -> bool:
        """Whether it can be placed."""
        if state.get(name) == "open":
            circle = chain[chain.index(name) :]
            if not any(set(circle) == set(known) for known in circles):
                circles.append(circle)
            return False
        if name in state:
            return state[name] == "done"
        state[name] = "open"
        sound = all([visit(other, [*chain, name]) for other in needs[name] if other in needs])
        state[name] = "done" if sound else "broken"
        if sound:
            order.append(name)
        return sound

    for start in needs:
        visit(start, [])
    return order, circles


def placement_order(
    layout: Mapping[str, PlacementSpec], items: Sequence[Slot] = ()
) -> tuple[list[str], list[list[str]]]:
    """The entries with what each refers to before it (else as written), and the circles that prevent it.

    With `items`, the names of items instead: all that have an entry. A circle is listed once, as the names along it;
    what is in or on a circle is missing from the order.
    """
    if not items:
        return _ordered({name: [other for _, other in references(layout[name])] for name in layout})
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
    return _ordered(needs)


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

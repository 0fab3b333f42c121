"""What is placed: logical objects, each with an entry of the layout or none, and the order in which they go.

A logical object is a slot of the World, or an entity that is in none. An entry of the layout is for one of them by
name, or for all of a category; a reference is one of them by name, or of a category, then the one of one's own number.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from anysim.model.world import EntityKind, World
from anysim_schemas.layout import PlacementSpec


class Item(NamedTuple):
    """A logical object or robot: the entities that it can be, of which at most one is present in an env."""

    name: str
    category: str
    instance: int
    entities: tuple[int, ...]
    robot: bool


def items_of(world: World) -> tuple[Item, ...]:
    """All of a World, in the order of their first entities."""
    found = [
        Item(s.name, s.category, s.instance, s.entities, world.entities[s.entities[0]].kind is EntityKind.ROBOT)
        for s in world.logical_objects.values()
    ]
    return tuple(sorted(found, key=lambda item: item.entities))


def entry_of(layout: Mapping[str, PlacementSpec], item: Item) -> str | None:
    """The name of the entry that holds for an item: its own, else that of its category."""
    return next((name for name in (item.name, item.category) if name in layout), None)


def meant(reference: str, items: Iterable[Item], by: Item | None = None) -> list[Item]:
    """The items that a name stands for, the best first: of a category, the instance of the same number."""
    items = tuple(items)
    exact = [item for item in items if item.name == reference]
    if exact:
        return exact
    of_kind = [item for item in items if item.category == reference]
    return sorted(of_kind, key=lambda item: (by is None or item.instance != by.instance, item.instance))


def ordered(needs: Mapping[str, Sequence[str]]) -> tuple[list[str], list[list[str]]]:
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

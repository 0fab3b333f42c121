"""Legend: the numbers of maps and boxes, and what they stand for: the same in every episode and on every engine."""

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.model.world import World
from anysim_sensors.sight.identities import Identities


class Thing(NamedTuple):
    """A logical object, whatever asset it is made of in an env.

    Attributes:
        id: its number in instance maps, from 1; 0 is the ground, and where nothing is.
        name: by which the world knows it.
        label: what kind of thing it is, as its file says, else its category.
        label_id: the number of its label in semantic maps, from 1.
        entities: those that it can be.
    """

    id: int
    name: str
    label: str
    label_id: int
    entities: tuple[int, ...]


class Legend:
    """Things and labels of a World.

    Attributes:
        things: in the order of the World.
        labels: sorted; the number of each is its place, from 1.
        instance, semantic: (entities + 1,) uint16, the numbers of each segmentation id of an engine.
    """

    def __init__(self, world: World) -> None:
        numbers = Identities.of(world)
        self.labels: tuple[str, ...] = tuple(numbers.classes)
        self.instance, self.semantic = numbers.instance.astype(np.uint16), numbers.class_.astype(np.uint16)
        self.things: tuple[Thing, ...] = tuple(
            Thing(numbers.instances[slot.name], slot.name, self.labels[label - 1], label, slot.entities)
            for slot in world.logical_objects.values()
            for label in [int(numbers.class_[slot.entities[0] + 1])]
        )

    @cached_property
    def of_entity(self) -> Sequence[Thing]:
        """The thing that each entity is."""
        found = {entity: thing for thing in self.things for entity in thing.entities}
        return [found[number] for number in range(len(found))]

    def there(self, present: Array) -> list[tuple[int, Thing]]:
        """The entities (index, thing) that are there, of (entities,) bool."""
        return [(number, self.of_entity[number]) for number in np.flatnonzero(present).tolist()]

    def to_dict(self) -> dict[str, object]:
        """Plain data, for files."""
        return {
            "instances": [{"id": t.id, "name": t.name, "label": t.label, "label_id": t.label_id} for t in self.things],
            "labels": {label: number for number, label in enumerate(self.labels, 1)},
        }

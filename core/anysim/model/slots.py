"""Logical objects of a World, of whatever assets they are made and whether they are there or not.

A logical object is (category, instance). Its name is that of a slot, or of an entity that is the same in every env.
"""

from dataclasses import replace

import numpy as np

from anysim.conventions import Array
from anysim.errors import NameLookupError, listing, suggest
from anysim.model.world import EntityKind, Slot, World

ABSENT = -1
"""The entity, or body, of a logical object that is not there."""


def logical_objects(world: World) -> dict[str, Slot]:
    """Every logical object by name, robots too; what is the same in every env is a slot of one entity."""
    of = {entity: slot for slot in world.slots for entity in slot.entities}
    found: dict[str, Slot] = {}
    for i, entity in enumerate(world.entities):
        slot = of.get(i) or Slot(entity.name, entity.category or entity.name, entity.instance, (i,))
        found.setdefault(slot.name, slot)
    return found


def categories(world: World) -> dict[str, tuple[Slot, ...]]:
    """The instances of each category of objects, in order."""
    found: dict[str, tuple[Slot, ...]] = {}
    for slot in world.logical_objects.values():
        if world.entities[slot.entities[0]].kind is EntityKind.OBJECT:
            found[slot.category] = (*found.get(slot.category, ()), slot)
    return found


def members(world: World, name: str) -> tuple[Slot, ...]:
    """The logical objects that a name stands for: one by its own name, all of a category, or an entity (`mug~1`) alone.

    Empty where the name stands for none.
    """
    one = world.logical_objects.get(name)
    if one is not None:
        return (one,)
    if name in world.categories:
        return world.categories[name]
    for i, entity in enumerate(world.entities):
        if entity.name == name:
            owner = next(slot for slot in world.logical_objects.values() if i in slot.entities)
            return (replace(owner, name=name, entities=(i,)),)
    return ()


def is_robot(world: World, slot: Slot) -> bool:
    """Whether a logical object is a robot."""
    return world.entities[slot.entities[0]].kind is EntityKind.ROBOT


def single(world: World, name: str) -> Slot:
    """The one logical object that a name stands for.

    Raises:
        NameLookupError: there is none, or the name is that of a category of several.
    """
    found = members(world, name)
    if len(found) == 1:
        return found[0]
    if found:
        raise NameLookupError(f"there are {len(found)} of '{name}'; say which: {listing([s.name for s in found])}")
    names = list(world.logical_objects)
    raise NameLookupError(f"there is no entity '{name}'{suggest(name, names)} (entities: {listing(names)})")


def active_entity(slot: Slot, presence: Array) -> Array:
    """(N,) int: which of a slot's entities is there in each env, or ABSENT; `presence` is (N, entities) bool."""
    choices = np.array(slot.entities)
    there = presence[:, choices]
    return np.where(there.any(axis=1), choices[there.argmax(axis=1)], ABSENT)

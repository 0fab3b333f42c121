"""Logical identity: which objects a World has, whatever they are made of and whether they are there.

A logical object is (category, instance). Its name is that of a slot, or of an entity that is the same in every env.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from anysim.conventions import Array
from anysim.errors import NameLookupError, listing, suggest
from anysim.world.forms import instances
from anysim.world.model import EntityKind, Slot, World
from anysim_schemas.objects import ObjectSpec

T = TypeVar("T")

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


def active(world: World, presence: Array) -> Array:
    """(N, S) int: the entity of each slot of the World in each env, or ABSENT; `presence` is (N, entities) bool."""
    columns = [active_entity(slot, presence) for slot in world.slots]
    return np.stack(columns, axis=1) if columns else np.zeros((len(presence), 0), dtype=int)


def by_object(given: Mapping[str, T], objects: Mapping[str, ObjectSpec]) -> dict[str, tuple[str, T]]:
    """For each logical object the key and value of a mapping by name: an entry of its own, else its category's.

    In the order of the mapping, a category's instances in its place. What the names do not stand for stays as it is.
    """
    made = {name: instances(name, spec) for name, spec in objects.items()}
    found: dict[str, tuple[str, T]] = {}
    for key, value in given.items():
        for name in made.get(key, (key,)):
            own = name in given
            found[name] = (name, given[name]) if own else (key, value)
    return found

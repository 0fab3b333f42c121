"""Pairs that never collide: the names of a spec, as pairs of bodies of a World."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import product

from anysim.conventions import GROUND, WORLD
from anysim.errors import NameLookupError, listing, suggest
from anysim.issues import Issues
from anysim.model.frames import find_bodies
from anysim.model.slots import members
from anysim.model.world import BodyKind, World
from anysim_schemas.collisions import CollisionsSpec

Members = Mapping[str, tuple[int, ...]]
"""The bodies of each thing that a name stands for: one thing, or the members of a group."""


def with_exclusions(world: World, spec: CollisionsSpec, issues: Issues) -> World:
    """The World without the collisions that a spec excludes; `issues` is at the path of `collisions`."""
    groups = {name: _group(world, name, members, issues.at("groups", name)) for name, members in spec.groups.items()}
    pairs: set[tuple[int, int]] = set()
    for i, pair in enumerate(spec.exclude):
        first, second = (_members(world, name, groups, issues.at("exclude", i, k)) for k, name in enumerate(pair))
        alone = pair[0] == pair[1] and pair[0] not in groups and len(first) == 1
        for (name, bodies), (other, others) in product(first.items(), second.items()):
            if name != other or alone:
                pairs |= {(min(a, b), max(a, b)) for a, b in product(bodies, others) if _could_meet(world, a, b)}
    return replace(world, excluded_pairs=world.excluded_pairs | pairs)


def _group(world: World, name: str, members: tuple[str, ...], issues: Issues) -> Members:
    taken = [GROUND, *dict.fromkeys([*world.categories, *world.logical_objects])]
    if name in taken:
        issues.add("", f"the name '{name}' is taken (entities: {listing(taken)}); give the group another one")
    found: dict[str, tuple[int, ...]] = {}
    for i, member in enumerate(members):
        found |= _members(world, member, {}, issues.at(i))
    return found


def _members(world: World, name: str, groups: Mapping[str, Members], issues: Issues) -> Members:
    if name in groups:
        return groups[name]
    try:
        slots = members(world, name)
        if len(slots) > 1:  # a category: each of its instances is a thing of its own
            return {slot.name: find_bodies(world, slot.name) for slot in slots}
        return {name: find_bodies(world, name)}
    except NameLookupError as error:
        owner = name.partition(".")[0]
        names = [*dict.fromkeys([*world.logical_objects, *world.categories]), GROUND]
        if owner in names:
            issues.add("", str(error))
        else:
            known = f"entities: {listing(names)}" + (f"; groups: {listing(groups)}" if groups else "")
            what = "entity or group" if groups else "entity"
            issues.add("", f"there is no {what} '{owner}'{suggest(owner, [*names, *groups])} ({known})")
        return {}


def _could_meet(world: World, a: int, b: int) -> bool:
    """Whether two bodies collide unless they are excluded."""
    if a == b:
        return False
    fixed = [body == WORLD or world.bodies[body].kind is BodyKind.STATIC for body in (a, b)]
    related = any(
        x != WORLD and world.bodies[x].kind is BodyKind.LINK and world.bodies[x].parent == y
        for x, y in ((a, b), (b, a))
    )
    return not (all(fixed) or related)

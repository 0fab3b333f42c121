"""Collisions of a spec: solids in place of a link's own geometry, and pairs of bodies that never collide."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.conventions import GROUND
from anysim.errors import AssetError, Issues, NameLookupError, listing, suggest
from anysim.math import pose as P
from anysim.model.frames import find_bodies
from anysim.model.hash import split
from anysim.model.pairs import could_meet
from anysim.model.slots import members
from anysim.model.world import Box, Capsule, Cylinder, Geom, Shape, Sphere, World
from anysim_schemas.collisions import CollisionsSpec
from anysim_schemas.robot_model import SolidSpec

Members = Mapping[str, tuple[int, ...]]
"""The bodies of each thing that a name stands for: one thing, or the members of a group."""


def with_exclusions(world: World, spec: CollisionsSpec, issues: Issues) -> World:
    """The World without the collisions that a spec excludes; `issues` is at the path of `collisions`."""
    groups = {name: _group(world, name, members, issues.at("groups", name)) for name, members in spec.groups.items()}
    pairs: set[tuple[int, int]] = set()
    for i, pair in enumerate(spec.exclude):
        first, second = (_members(world, name, groups, issues.at("exclude", i, k)) for k, name in enumerate(pair))
        rows, columns = (sorted({body for own in some.values() for body in own}) for some in (first, second))
        meet = could_meet(world, np.array(rows, dtype=int), np.array(columns, dtype=int))
        row, column = ({body: k for k, body in enumerate(some)} for some in (rows, columns))
        alone = pair[0] == pair[1] and pair[0] not in groups and len(first) == 1
        for (name, own), (other, others) in product(first.items(), second.items()):
            if name != other or alone:
                pairs |= {(min(a, b), max(a, b)) for a, b in product(own, others) if meet[row[a], column[b]]}
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


def with_solids(model: ImportedModel, solids: Mapping[str, Sequence[SolidSpec]]) -> ImportedModel:
    """The model with the collision geometry of some links replaced; what is seen of them stays.

    Args:
        model: whose masses and visual geometry do not change.
        solids: for each link what it collides with, in the link's frame; nothing lets it touch nothing, and takes it
            from pictures where it had no other shape.

    Raises:
        AssetError: there is no such link.
    """
    if not solids:
        return model
    frames = {link: (body, P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))) for link, body in model.links.items()}
    frames |= {s.name: (s.body, P.pose(s.position, s.quaternion)) for s in model.sites if s.name in frames}
    for link in solids:
        if link not in frames:
            known = f"{suggest(link, list(frames))} (links: {listing(frames, 20)})"
            raise AssetError(f"collision: '{model.name}' has no link '{link}'{known}")
    geoms: list[Geom] = []
    links: list[str] = []
    for geom, link in zip(model.geoms, model.geom_links, strict=True):
        if link not in solids or not geom.collides:
            geoms.append(geom)
        elif geom.visible and solids[link]:
            geoms.append(replace(geom, collides=False))
        else:
            continue
        links.append(link)
    for link, several in solids.items():
        body, frame = frames[link]
        for number, solid in enumerate(several):
            local = P.pose(solid.position, P.from_roll_pitch_yaw(np.array(solid.roll_pitch_yaw)))
            position, quaternion = split(P.compose(frame, local))
            name = f"{link}.solid{number}"
            geoms.append(Geom(name, body, _shape(solid), position, quaternion, collides=True, visible=False))
            links.append(link)
    return replace(model, geoms=tuple(geoms), geom_links=tuple(links))


def _shape(solid: SolidSpec) -> Shape:
    """The shape with half sizes, as the World has them."""
    if solid.box is not None:
        x, y, z = solid.box
        return Box((x / 2, y / 2, z / 2))
    if solid.cylinder is not None:
        return Cylinder(solid.cylinder[0], solid.cylinder[1] / 2)
    if solid.capsule is not None:
        return Capsule(solid.capsule[0], solid.capsule[1] / 2)
    if solid.sphere is None:
        raise ValueError("a solid has exactly one shape")
    return Sphere(solid.sphere)

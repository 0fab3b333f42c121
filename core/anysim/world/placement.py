"""Where things are nominally: the layout with the middle of its ranges, support chains resolved."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from anysim.conventions import GROUND, Array
from anysim.errors import listing, suggest
from anysim.math import pose as P
from anysim.world.forms import INSTANCER, instances
from anysim.world.geometry import EntityShape, ground_top
from anysim.world.issues import Issues
from anysim.world.model import Body, BodyKind, Entity, Slot, World
from anysim.world.nominal import nominal
from anysim.world.rounding import split
from anysim.world.slots import by_object, single
from anysim_schemas.layout import PlacementSpec
from anysim_schemas.objects import ObjectSpec


def placement_order(layout: Mapping[str, PlacementSpec]) -> tuple[list[str], list[list[str]]]:
    """The entries with every support before what rests on it (else as written), and the cycles that prevent it.

    A cycle is listed once, as the names along it; what is in or on a cycle is missing from the order.
    """
    order: list[str] = []
    cycles: list[list[str]] = []
    state: dict[str, str] = {}
    for start in layout:
        chain: list[str] = []
        name = start
        while name in layout and name not in state:
            state[name] = "open"
            chain.append(name)
            name = layout[name].on or ""
        broken = state.get(name, "done") != "done"
        if broken and name in chain:
            cycles.append(chain[chain.index(name) :])
        for link in reversed(chain):
            state[link] = "broken" if broken else "done"
            if not broken:
                order.append(link)
    return order, cycles


def check_layout(
    layout: Mapping[str, PlacementSpec], objects: Mapping[str, ObjectSpec], robots: Sequence[str], issues: Issues,
    fixtures: Sequence[str] = (),
) -> list[str]:  # fmt: skip
    """The logical objects that can be placed, in order; what is wrong goes to `issues`, at the path of the layout.

    `fixtures` have their place and can carry others: the furniture of a room.
    """
    logical = [one for name, spec in objects.items() for one in instances(name, spec)]
    known = list(dict.fromkeys([*objects, *logical]))
    supports = [*logical, *robots, *fixtures, GROUND]
    for name, spec in layout.items():
        if name in robots:
            issues.add(name, f"'{name}' is a robot; its place is in world.robots.{name} (position, yaw)")
        elif name not in known:
            issues.add(name, f"there is no object '{name}'{suggest(name, known)} (objects: {listing(known)})")
        if spec.on is not None and spec.on not in supports:
            several = instances(spec.on, objects[spec.on]) if spec.on in objects else ()
            named = f"{suggest(spec.on, supports)} (objects: {listing(supports)})"
            message = f"there is no object '{spec.on}' to rest on{named}"
            if several:
                message = f"there are {len(several)} of '{spec.on}'; rest on one of them: {listing(several)}"
            issues.add(f"{name}.on", message)
    entries = by_object(layout, objects)
    order, cycles = placement_order({name: entry for name, (_, entry) in entries.items()})
    for cycle in cycles:
        issues.add(
            f"{entries[cycle[0]][0]}.on",
            f"the objects rest on each other in a circle: {' on '.join([*cycle, cycle[0]])}",
        )
    placeable = {name: entry for name, (_, entry) in entries.items() if name in logical}
    return [name for name in order if name in placeable and placeable[name].on in (None, *supports)]


def placed(
    world: World, name: str, spec: PlacementSpec, value: Callable[[Any], Any], supports: Mapping[str, Array]
) -> Array:
    """The root pose (..., 7) of an object whose placement has the drawn or nominal values `value(field)`.

    `supports` has the root poses of entities placed before; others are at the World's initial ones.
    """
    angles = np.stack(np.broadcast_arrays(value(spec.roll), value(spec.pitch), value(spec.yaw)), axis=-1)
    quaternion = P.from_roll_pitch_yaw(angles)
    if spec.position is not None:
        position = np.asarray(value(spec.position), dtype=float)
        shape = np.broadcast_shapes(position.shape[:-1], quaternion.shape[:-1])
        parts = [np.broadcast_to(position, (*shape, 3)), np.broadcast_to(quaternion, (*shape, 4))]
        return np.concatenate(parts, axis=-1)
    x, y = np.asarray(value(spec.x), dtype=float), np.asarray(value(spec.y), dtype=float)
    own = EntityShape(world, name)
    if spec.on == GROUND:
        flat = own.resting_on(np.array(0.0), x, y, quaternion)
        low, high = own.bounds(flat)
        return own.resting_on(ground_top(world, low[..., :2], high[..., :2]), x, y, quaternion)
    assert spec.on is not None  # a placement has either a position or a support
    support = EntityShape(world, world.entities[single(world, spec.on).entities[0]].name)
    return own.resting_on(support.top_height(supports.get(spec.on, initial_root(world, spec.on))), x, y, quaternion)


def initial_root(world: World, name: str) -> Array:
    """The initial pose (7,) of the root of a logical object, as it is nominally."""
    root = world.entities[single(world, name).entities[0]].root
    return P.pose(world.bodies[root].position, world.bodies[root].quaternion)


def roots_of(world: World, entity: Entity) -> range:
    """The root bodies of an entity: one, or those of all instances of an instancer."""
    return range(entity.body_start, entity.body_stop if entity.family == INSTANCER else entity.body_start + 1)


def root_offsets(world: World, entity: Entity) -> Array:
    """Poses (K, 7) of the root bodies of an entity in the frame of the first of them, as they are nominally."""
    roots = [world.bodies[b] for b in roots_of(world, entity)]
    poses = np.array([[*body.position, *body.quaternion] for body in roots])
    return P.compose(np.broadcast_to(P.inverse(poses[0]), poses.shape), poses)


def place_nominally(world: World, layout: Mapping[str, PlacementSpec], order: Sequence[str]) -> World:
    """The World with its objects where the layout, by logical object, has them nominally.

    An object without an entry that moves freely is set onto the ground at the origin (several of a category in a row
    from there, along x), a fixed one with its frame there.
    All that an object can be is at its place: no two of them are there at once.
    """
    poses: dict[str, Array] = {}
    objects = {slot.name: slot for group in world.categories.values() for slot in group}
    free = [
        name for name, slot in objects.items()
        if name not in layout and world.bodies[world.entities[slot.entities[0]].root].kind is BodyKind.FREE
    ]  # fmt: skip
    bodies = list(world.bodies)
    for name in [*order, *free]:
        if name not in objects:  # an object whose import failed is not there
            continue
        for index in reversed(objects[name].entities):  # the nominal one last: others rest on it
            entity = world.entities[index]
            entry = layout.get(name) or _in_a_row(world, objects[name], entity)
            pose = placed(world, entity.name, entry, nominal, poses)
            _move(world, bodies, entity, pose)
        poses[name] = pose
    return replace(world, bodies=tuple(bodies))


def _in_a_row(world: World, slot: Slot, entity: Entity) -> PlacementSpec:
    """The entry of what has none: on the ground, the instances of a category side by side."""
    step = 0.0 if slot.instance == 0 else 2.2 * EntityShape(world, entity.name).radius
    return PlacementSpec(on=GROUND, x=step * slot.instance)


def _move(world: World, bodies: list[Body], entity: Entity, pose: Array) -> None:
    """Put the root of an entity to a pose (7,), and with it the other roots that it has."""
    placed = P.compose(np.broadcast_to(pose, (len(roots_of(world, entity)), 7)), root_offsets(world, entity))
    placed[0] = pose
    for i, one in zip(roots_of(world, entity), placed, strict=True):
        position, quaternion = split(one)
        bodies[i] = replace(world.bodies[i], position=position, quaternion=quaternion)

"""Where things are nominally: the layout with the middle of its ranges, support chains resolved."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from anysim.conventions import GROUND, Array
from anysim.errors import listing, suggest
from anysim.math import pose as P
from anysim.world.geometry import EntityShape, ground_top
from anysim.world.issues import Issues
from anysim.world.model import BodyKind, World
from anysim.world.nominal import nominal
from anysim.world.rounding import split
from anysim_schemas.layout import PlacementSpec


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
    layout: Mapping[str, PlacementSpec], objects: Sequence[str], robots: Sequence[str], issues: Issues,
    fixtures: Sequence[str] = (),
) -> list[str]:  # fmt: skip
    """The entries that can be placed, in order; what is wrong goes to `issues`, whose path is that of the layout.

    `fixtures` have their place and can carry others: the furniture of a room.
    """
    supports = [*objects, *robots, *fixtures, GROUND]
    for name, spec in layout.items():
        if name in robots:
            issues.add(name, f"'{name}' is a robot; its place is in world.robots.{name} (position, yaw)")
        elif name not in objects:
            issues.add(name, f"there is no object '{name}'{suggest(name, objects)} (objects: {listing(objects)})")
        if spec.on is not None and spec.on not in supports:
            known = f"{suggest(spec.on, supports)} (objects: {listing(supports)})"
            issues.add(f"{name}.on", f"there is no object '{spec.on}' to rest on{known}")
    order, cycles = placement_order(layout)
    for cycle in cycles:
        issues.add(f"{cycle[0]}.on", f"the objects rest on each other in a circle: {' on '.join([*cycle, cycle[0]])}")
    return [name for name in order if name in objects and (layout[name].on is None or layout[name].on in supports)]


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
    support = EntityShape(world, spec.on)
    return own.resting_on(support.top_height(supports.get(spec.on, initial_root(world, spec.on))), x, y, quaternion)


def initial_root(world: World, name: str) -> Array:
    """The initial pose (7,) of an entity's root."""
    root = next(e.root for e in world.entities if e.name == name)
    return P.pose(world.bodies[root].position, world.bodies[root].quaternion)


def place_nominally(world: World, layout: Mapping[str, PlacementSpec], order: Sequence[str]) -> World:
    """The World with its objects where the layout has them nominally.

    An object without an entry that moves freely is set onto the ground at the origin, a fixed one with its frame there.
    """
    poses: dict[str, Array] = {}
    resting = PlacementSpec(on=GROUND)
    names = [entity.name for entity in world.entities]
    free = [
        e.name for e in world.entities
        if e.name not in layout and e.kind == "object" and world.bodies[e.root].kind is BodyKind.FREE
    ]  # fmt: skip
    for name in [*order, *free]:
        if name in names:  # an object whose import failed is not there
            poses[name] = placed(world, name, layout.get(name, resting), nominal, poses)
    bodies = list(world.bodies)
    for name, pose in poses.items():
        root = next(e.root for e in world.entities if e.name == name)
        position, quaternion = split(pose)
        bodies[root] = replace(bodies[root], position=position, quaternion=quaternion)
    return replace(world, bodies=tuple(bodies))

"""Frames and bodies of a World by name: what things are mounted on, and what is sensed."""

from typing import NamedTuple

from anysim.conventions import GROUND, IDENTITY_QUATERNION, WORLD
from anysim.errors import NameLookupError, listing, suggest
from anysim.model.slots import members
from anysim.model.world import ORIGIN, Entity, Quat, Slot, Vec3, World


class FixedFrame(NamedTuple):
    """A frame fixed to a body (-1: the world), with its pose in the body's frame."""

    body: int
    position: Vec3
    quaternion: Quat


def find_frame(world: World, name: str) -> FixedFrame:
    """A tool (`panda.tool`), link, lumped link, or entity (its root) by name; it is the same in every env.

    Raises:
        NameLookupError: lists the frames of the entity that is meant, or the entities.
    """
    found = _frame(world, name)
    if found is None:
        raise NameLookupError(_unknown(world, name))
    return found


def _frame(world: World, name: str) -> FixedFrame | None:
    owner, _, part = name.partition(".")
    robot = next((r for r in world.robots if r.name == owner), None)
    site = robot.tools.get(part) if robot is not None else None
    if site is None:
        site = next((i for i, s in enumerate(world.sites) if s.name == name), None)
    if site is not None:
        found = world.sites[site]
        return FixedFrame(found.body, found.position, found.quaternion)
    body = next((i for i, b in enumerate(world.bodies) if b.name == name), None)
    if body is None:
        body = next((e.root for e in world.entities if e.name == name), None)
    return None if body is None else FixedFrame(body, ORIGIN, IDENTITY_QUATERNION)


def frames_of(world: World, name: str) -> tuple[tuple[Slot, tuple[FixedFrame, ...]], ...]:
    """A frame of logical objects: `mug.handle` is that of whatever the mug is, `cube` that of every cube.

    Returns:
        For each logical object that is meant the frame on each of its entities, in the order of `Slot.entities`.

    Raises:
        NameLookupError: there is no such object, or something that it can be has no such frame.
    """
    owner, dot, part = name.partition(".")
    slots = members(world, owner)
    if not slots:
        raise NameLookupError(_unknown(world, name))
    return tuple((slot, tuple(_on(world, slot, e, dot + part) for e in slot.entities)) for slot in slots)


def _on(world: World, slot: Slot, entity: int, part: str) -> FixedFrame:
    name = world.entities[entity].name
    found = _frame(world, name + part)
    if found is not None:
        return found
    if len(slot.entities) == 1:
        raise NameLookupError(_unknown(world, name + part))
    without = [world.entities[e].name for e in slot.entities if _frame(world, world.entities[e].name + part) is None]
    raise NameLookupError(
        f"'{slot.name}{part}' is not there in all that '{slot.name}' can be: {listing(without)} "
        f"{'has' if len(without) == 1 else 'have'} no such frame ({_unknown(world, name + part)})"
    )


def find_bodies(world: World, name: str) -> tuple[int, ...]:
    """The bodies that a name stands for: all of an entity's, the one of a link, or the world (-1) for the ground.

    For something that can be several things, or of which there are several, those of all of them.
    """
    if name == GROUND:
        return (WORLD,)
    if "." in name:
        return tuple(frame.body for _, frames in frames_of(world, name) for frame in frames)
    slots = members(world, name)
    if not slots:
        return (find_frame(world, name).body,)
    return tuple(b for slot in slots for e in sorted(slot.entities) for b in _bodies(world.entities[e]))


def _bodies(entity: Entity) -> range:
    return range(entity.body_start, entity.body_stop)


def _unknown(world: World, name: str) -> str:
    owner, _, part = name.partition(".")
    entity = next((e for e in world.entities if e.name == owner), None)
    slots = members(world, owner)
    if entity is None and slots:
        every = [world.entities[e].name for slot in slots for e in slot.entities]
        what = "can be" if len(slots) == 1 else "stands for"
        return f"'{owner}' {what} {len(every)} entities; name one of them: {listing(every)}"
    if entity is None or not part:
        names = [e.name for e in world.entities]
        return f"there is no entity '{owner}'{suggest(owner, names)} (entities: {listing(names)})"
    bodies = range(entity.body_start, entity.body_stop)
    names = [world.bodies[i].name for i in bodies] + [s.name for s in world.sites if s.body in bodies]
    return f"'{owner}' has no link or tool '{part}'{suggest(name, names)} (frames: {listing(names, 20)})"

"""Names in a World while it is being made: frames that things are mounted on, bodies that are sensed."""

from typing import NamedTuple

from anysim.conventions import GROUND, IDENTITY_QUATERNION, WORLD
from anysim.errors import NameLookupError, listing, suggest
from anysim.world.model import ORIGIN, Quat, Vec3, World


class Frame(NamedTuple):
    """A frame fixed to a body (-1: the world), with its pose in the body's frame."""

    body: int
    position: Vec3
    quaternion: Quat


def find_frame(world: World, name: str) -> Frame:
    """A tool (`panda.tool`), link, lumped link, or entity (its root) by name.

    Raises:
        NameLookupError: lists the frames of the entity that is meant, or the entities.
    """
    owner, _, part = name.partition(".")
    robot = next((r for r in world.robots if r.name == owner), None)
    site = robot.tools.get(part) if robot is not None else None
    if site is None:
        site = next((i for i, s in enumerate(world.sites) if s.name == name), None)
    if site is not None:
        found = world.sites[site]
        return Frame(found.body, found.position, found.quaternion)
    body = next((i for i, b in enumerate(world.bodies) if b.name == name), None)
    if body is None:
        body = next((e.root for e in world.entities if e.name == name), None)
    if body is None:
        raise NameLookupError(_unknown(world, name))
    return Frame(body, ORIGIN, IDENTITY_QUATERNION)


def find_bodies(world: World, name: str) -> tuple[int, ...]:
    """The bodies that a name stands for: all of an entity's, the one of a link, or the world (-1) for the ground."""
    if name == GROUND:
        return (WORLD,)
    for entity in world.entities:
        if entity.name == name:
            return tuple(range(entity.body_start, entity.body_stop))
    return (find_frame(world, name).body,)


def _unknown(world: World, name: str) -> str:
    owner, _, part = name.partition(".")
    entity = next((e for e in world.entities if e.name == owner), None)
    if entity is None or not part:
        names = [e.name for e in world.entities]
        return f"there is no entity '{owner}'{suggest(owner, names)} (entities: {listing(names)})"
    bodies = range(entity.body_start, entity.body_stop)
    names = [world.bodies[i].name for i in bodies] + [s.name for s in world.sites if s.body in bodies]
    return f"'{owner}' has no link or tool '{part}'{suggest(name, names)} (frames: {listing(names, 20)})"

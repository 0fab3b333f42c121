"""Targets of skills: the thing, or the part of one, that a command is about, by its parameters."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from anysim.errors import NameLookupError
from anysim.model.frames import find_frame
from anysim.model.slots import ABSENT, active_entity, members
from anysim.model.world import World
from anysim_annotation.legend import Thing
from anysim_annotation.view import Segment

TARGET_KEYS = ("object", "part", "button", "surface")
"""Parameters of skills that say what they act on; the first that is given counts."""


class Target(NamedTuple):
    """What a segment is about.

    Attributes:
        name: as the command has it, such as `cabinet.drawer_1`.
        thing: the logical object.
        entity: which of the entities that it can be is there.
        bodies: of that thing, or of the part with all that it carries.
    """

    name: str
    thing: Thing
    entity: int
    bodies: tuple[int, ...]


def target_of(segment: Segment) -> Target | None:
    """The target of a segment; None where its command names none, or several, or what is not there."""
    scene, params = segment.first.scene, segment.params
    name = next((str(params[key]) for key in TARGET_KEYS if isinstance(params.get(key), str)), "")
    owner, _, part = name.partition(".")
    slots = members(scene.world, owner)
    if len(slots) != 1:
        return None
    entity = int(active_entity(slots[0], segment.first.present)[0])
    if entity == ABSENT:
        return None
    found = scene.world.entities[entity]
    bodies = tuple(range(found.body_start, found.body_stop))
    if part:
        body = _body(scene.world, f"{found.name}.{part}")
        if body < 0:
            return None
        bodies = scene.world.carried_by(body)
    return Target(name, scene.legend.of_entity[entity], entity, bodies)


def _body(world: World, name: str) -> int:
    """The body that a joint of this name moves, or that a frame is on; -1 where there is neither."""
    moved = next((joint.body for joint in world.joints if joint.name == name), -1)
    if moved >= 0:
        return moved
    try:
        return find_frame(world, name).body
    except NameLookupError:
        return -1


def robot_of(params: Mapping[str, Any], robots: tuple[str, ...]) -> tuple[str, ...]:
    """The robots that a command names; all where it names none."""
    named = tuple(str(params[key]) for key in ("robot", "partner") if params.get(key) in robots)
    return named or robots

"""The room of a world: its things come from the builder of the kind `rooms`, an installed function of a `RoomSpec`."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from anysim import registry
from anysim.assets.model import ImportedModel
from anysim.compile.builder import WorldBuilder
from anysim.errors import Issues, PluginError
from anysim.model.world import BodyKind, EntityKind, Quat, Vec3
from anysim_schemas.rooms import RoomSpec, furniture_names
from anysim_schemas.run import WorldSpec

BUILDER = "furnished"
"""The name of the entry point of the group `anysim.rooms` that builds what `room:` describes."""

ROOM = "room"
"""The name of the shell of a room as an entity. Its geoms are called floor, wall…, lintel…, sill…, pane…, ceiling."""

MAIN = "main"
"""How the names of those geoms of a piece begin that have its colour."""


class RoomThing(NamedTuple):
    """A static thing of a room: its shell, or a piece of furniture. `label` is its kind, lengths are in metres."""

    name: str
    label: str
    model: ImportedModel
    position: Vec3
    quaternion: Quat


RoomBuilder = Callable[[RoomSpec, Issues], Sequence[RoomThing]]
"""The shell and each of `furniture_names(spec)`; nothing, with the reasons in the issues, where they do not fit."""


def add_room(builder: WorldBuilder, content: WorldSpec, issues: Issues) -> None:
    """The room of a world, if it has one; what is wrong goes to `issues`, whose path is that of the world."""
    spec = content.room
    if spec is None:
        return
    if content.terrain.kind != "plane":
        issues.add("room", f"a room stands on a plane; world.terrain is {content.terrain.kind}")
    names = [ROOM, *furniture_names(spec)]
    for key, taken in (("objects", content.objects), ("robots", content.robots)):
        for name in taken:
            if name in names:
                what = "the room itself" if name == ROOM else "a piece of furniture"
                issues.add(f"{key}.{name}", f"'{name}' is {what} (world.room); give this one another name")
    try:
        build: RoomBuilder = registry.load("rooms", BUILDER)
    except PluginError as error:
        issues.add("room", str(error))
        return
    with registry.using("rooms", BUILDER):
        things = build(spec, issues.at("room"))
    if things:  # the floor is seen in place of the ground, which stays what things touch
        builder.geoms = [replace(geom, visible=False) for geom in builder.geoms]
    for thing in things:
        builder.add(
            thing.name,
            EntityKind.OBJECT,
            thing.model,
            root=BodyKind.STATIC,
            position=thing.position,
            quaternion=thing.quaternion,
            label=thing.label,
            source=f"room:{thing.label}",
        )

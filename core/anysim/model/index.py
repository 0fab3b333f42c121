"""Indices of names, looked up once, at build, and names that two Worlds have in common."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from anysim.conventions import GROUND, IDENTITY_QUATERNION, WORLD, Array
from anysim.errors import NameLookupError, listing, suggest
from anysim.model.frames import FixedFrame, find_frame
from anysim.model.slots import members
from anysim.model.world import ORIGIN, Entity, EntityKind, Robot, World

T = TypeVar("T")


def names_of(world: World, kind: str) -> tuple[str, ...]:
    """The names of things of a kind (`bodies`, `joints`, …), in their order; `world` is the World itself."""
    return ("world",) if kind == "world" else tuple(thing.name for thing in getattr(world, kind))


def paired_names(before: Sequence[str], after: Sequence[str]) -> tuple[Array, Array]:
    """Indices (K,), (K,) of the names that are in both lists, in the order of the second."""
    places = {name: i for i, name in enumerate(before)}
    pairs = np.array([(places[name], i) for i, name in enumerate(after) if name in places], dtype=int).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]


def paired(before: World, after: World, kind: str) -> tuple[Array, Array]:
    """Indices (K,), (K,) of the things of a kind that have the same name in both Worlds."""
    return paired_names(names_of(before, kind), names_of(after, kind))


class Index:
    """Looks names of one World up. Every method raises NameLookupError with what exists and the nearest name."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._bodies = {b.name: i for i, b in enumerate(world.bodies)}
        self._joints = {j.name: i for i, j in enumerate(world.joints)}
        self._geoms = {g.name: i for i, g in enumerate(world.geoms)}
        self._sites = {s.name: i for i, s in enumerate(world.sites)}
        self._actuators = {a.name: i for i, a in enumerate(world.actuators)}
        self._cameras = {c.name: i for i, c in enumerate(world.cameras)}
        self._entities = {e.name: i for i, e in enumerate(world.entities)}
        self._robots = {r.name: r for r in world.robots}

    def _find(self, kind: str, table: dict[str, T], name: str) -> T:
        found = table.get(name)
        if found is None:
            raise NameLookupError(
                f"the world '{self.world.name}' has no {kind} named '{name}'{suggest(name, list(table))} "
                f"({kind}s: {listing(table)})"
            )
        return found

    def body(self, name: str) -> int:
        """Index of a body by full name, or of an entity's root body."""
        entity = self._entities.get(name)
        return self.world.entities[entity].root if entity is not None else self._find("body", self._bodies, name)

    def joint(self, name: str) -> int:
        return self._find("joint", self._joints, name)

    def geom(self, name: str) -> int:
        return self._find("geom", self._geoms, name)

    def site(self, name: str) -> int:
        return self._find("site", self._sites, name)

    def actuator(self, name: str) -> int:
        return self._find("actuator", self._actuators, name)

    def camera(self, name: str) -> int:
        return self._find("camera", self._cameras, name)

    def entity(self, name: str) -> Entity:
        """An entity by name; what can be several things is none, but each of these is (`mug~1`)."""
        return self.world.entities[self._entity(name)]

    def _entity(self, name: str) -> int:
        slots = () if name in self._entities else members(self.world, name)
        if slots:
            every = [self.world.entities[e].name for slot in slots for e in sorted(slot.entities)]
            raise NameLookupError(
                f"'{name}' stands for {len(every)} entities of the world '{self.world.name}'; name one of them: "
                f"{listing(every)}"
            )
        return self._find("entity", self._entities, name)

    def segmentation_id(self, name: str) -> int:
        """The id of an entity in segmentation images; 0 is the ground and the background."""
        return 0 if name == GROUND else self._entity(name) + 1

    def segmentation_ids(self, name: str) -> tuple[int, ...]:
        """The ids of all that a name stands for in segmentation images: an entity, what a slot can be, a category."""
        slots = members(self.world, name)
        if not slots:
            return (self.segmentation_id(name),)
        return tuple(sorted(entity + 1 for slot in slots for entity in slot.entities))

    def robot(self, name: str | None = None) -> Robot:
        """A robot by name; None means the only one there is."""
        if name is None:
            if len(self._robots) != 1:
                raise NameLookupError(f"name one of the world's robots: {listing(self._robots)}")
            return next(iter(self._robots.values()))
        return self._find("robot", self._robots, name)

    def robot_joints(self, name: str | None = None) -> Sequence[int]:
        """The world indices of a robot's joints, in order."""
        entity = self.entity(self.robot(name).name)
        return range(entity.joint_start, entity.joint_stop)

    def geoms_of(self, entity: Entity) -> list[int]:
        """The geoms on an entity's bodies."""
        return [i for i, g in enumerate(self.world.geoms) if entity.body_start <= g.body < entity.body_stop]

    def frame(self, name: str) -> FixedFrame:
        """A frame by reference: an entity, a body (`panda.panda_hand`), a site, a robot's tool, or the ground."""
        return FixedFrame(WORLD, ORIGIN, IDENTITY_QUATERNION) if name == GROUND else find_frame(self.world, name)

    @property
    def objects(self) -> list[Entity]:
        """The entities that are no robots."""
        return [e for e in self.world.entities if e.kind is EntityKind.OBJECT]

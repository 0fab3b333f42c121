"""LayoutManager: a pose for every placed object, from the declarative layout of the spec."""

from typing import Any

import numpy as np

from anysim.conventions import GROUND, Array
from anysim.errors import TaskError
from anysim.managers.base import Manager
from anysim.managers.values import draw
from anysim.math import pose as P
from anysim.world.geometry import EntityShape, ground_top
from anysim.world.model import BodyKind, World
from anysim.world.placement import initial_root, placement_order, root_offsets, roots_of
from anysim.world.slots import ABSENT, by_object
from anysim_schemas.layout import PlacementSpec

ATTEMPTS = 100
"""Draws of one object's place before the layout is given up."""


class LayoutManager(Manager):
    """Draws poses in the order of support (a table before what stands on it) and writes them to the engine."""

    name = "layout"

    def build(self, world: World) -> None:
        self._world = world
        entries = by_object(self.spec.world.layout, self.spec.world.objects)
        self._entries = {name: entry for name, entry in entries.items() if name in world.logical_objects}
        order = placement_order({name: entry for name, (_, entry) in self._entries.items()})[0]
        self._order = [name for name in order if name in self._entries]
        self._slots = world.logical_objects
        used = {*self._order, *(entry.on for _, entry in self._entries.values())} - {None, GROUND}
        every = [e for name in used if name for e in self._slots[name].entities]
        self._shapes = {e: EntityShape(world, world.entities[e].name) for e in every}
        self._placed = [e for name in self._order for e in self._slots[name].entities]
        self._column = {entity: k for k, entity in enumerate(self._placed)}
        offsets = [root_offsets(world, world.entities[e]) for e in self._placed]
        self._roots = np.array([b for e in self._placed for b in roots_of(world, world.entities[e])], dtype=int)
        self._owner = np.repeat(np.arange(len(offsets)), [len(own) for own in offsets])
        self._offsets = np.concatenate([np.zeros((0, 7)), *offsets])
        self._several = np.array([len(offsets[k]) > 1 for k in self._owner], dtype=bool)
        self._free = np.array([world.bodies[b].kind is BodyKind.FREE for b in self._roots], dtype=bool)

    def reset(self, env_ids: Array) -> None:
        if not self._order:
            return
        presence = self.engine.presence
        roots = np.stack([self._place(int(env), presence[env]) for env in env_ids])[:, self._owner]
        poses = roots.copy()
        moved = roots[:, self._several]
        poses[:, self._several] = P.compose(moved, np.broadcast_to(self._offsets[self._several], moved.shape))
        free = self._roots[self._free]
        if len(free):
            self.engine.set_body_state(poses[:, self._free], np.zeros((len(env_ids), len(free), 6)), env_ids, free)
        fixed = self._roots[~self._free]
        if len(fixed):
            self.engine.set_body_state(poses[:, ~self._free], None, env_ids, fixed)

    def _place(self, env: int, present: Array) -> Array:
        """Poses (K, 7) of the roots of all that can be placed, in an env where `present` (entities,) is there.

        What is absent keeps the world's frame: the engine heeds no pose of it.
        """
        placed: dict[str, Array] = {}
        poses = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(self._placed), 1))
        self._there = {
            name: next((e for e in slot.entities if present[e]), ABSENT) for name, slot in self._slots.items()
        }
        for name in self._order:
            if self._there[name] == ABSENT:
                continue
            key, entry = self._entries[name]
            for attempt in range(ATTEMPTS):
                pose = self._draw_pose(env, name, entry, placed, attempt)
                crowding = self._crowding(name, entry, pose, placed)
                if crowding is None:
                    placed[name] = poses[self._column[self._there[name]]] = pose
                    break
            else:
                raise TaskError(
                    f"env {env}: no place for '{name}' in {ATTEMPTS} draws that keeps its clearance of "
                    f"{entry.clearance:g} m from '{crowding}'; widen world.layout.{key} or lower its clearance"
                )
        return poses

    def _draw_pose(self, env: int, name: str, entry: PlacementSpec, placed: dict[str, Array], attempt: int) -> Array:
        def value(field: str) -> float:
            return self._draw(env, name, entry, field, attempt)

        turn = P.from_roll_pitch_yaw(np.array([value("roll"), value("pitch"), value("yaw")]))
        if entry.on is None:
            position = self._draw(env, name, entry, "position", attempt)
            return np.concatenate([np.asarray(position, dtype=float), turn])
        shape, x, y = self._shapes[self._there[name]], value("x"), value("y")
        if entry.on == GROUND or self._there[entry.on] == ABSENT:  # what it stands on is not there: on the ground
            low, high = shape.bounds(np.concatenate([[x, y, 0.0], turn]))
            top = ground_top(self._world, low[:2], high[:2])
        else:
            support = placed.get(entry.on, initial_root(self._world, entry.on))
            top = self._shapes[self._there[entry.on]].top_height(support)
        return shape.resting_on(top, np.asarray(x), np.asarray(y), turn)

    def _draw(self, env: int, name: str, entry: PlacementSpec, field: str, attempt: int) -> Any:
        source = f"world.layout.{self._entries[name][0]}.{field}"
        return draw(getattr(entry, field), f"layout/{name}/{field}", self.streams, env, attempt, source=source)

    def _crowding(self, name: str, entry: PlacementSpec, pose: Array, placed: dict[str, Array]) -> str | None:
        """The first placed object that is nearer than the clearance, measured between balls around both."""
        if entry.clearance <= 0:
            return None
        for other, theirs in placed.items():
            if other == entry.on:
                continue
            gap = float(P.norm(pose[:3] - theirs[:3])) - self._radius(name) - self._radius(other)
            if gap < entry.clearance:
                return other
        return None

    def _radius(self, name: str) -> float:
        return self._shapes[self._there[name]].radius

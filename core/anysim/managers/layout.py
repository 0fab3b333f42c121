"""LayoutManager: a pose for every placed object, from the declarative layout of the spec."""

from typing import Any

import numpy as np

from anysim.conventions import GROUND, Array
from anysim.errors import TaskError
from anysim.managers.base import Manager
from anysim.managers.overrides import WORLD, Overridable, drawn
from anysim.managers.values import draw
from anysim.math import pose as P
from anysim.world.geometry import EntityShape, ground_top
from anysim.world.model import BodyKind, World
from anysim.world.placement import placement_order
from anysim_schemas.layout import PlacementSpec

ATTEMPTS = 100
"""Draws of one object's place before the layout is given up."""


class LayoutManager(Manager):
    """Draws poses in the order of support (a table before what stands on it) and writes them to the engine."""

    name = "layout"

    def build(self, world: World) -> None:
        self._world = world
        entities = {e.name: e for e in world.entities}
        self._order = [name for name in placement_order(self.spec.world.layout)[0] if name in entities]
        self._roots = np.array([entities[name].root for name in self._order], dtype=int)
        self._free = np.array([world.bodies[r].kind is BodyKind.FREE for r in self._roots], dtype=bool)
        supports = {self.spec.world.layout[name].on for name in self._order} - {None, GROUND}
        self._shapes = {name: EntityShape(world, name) for name in {*self._order, *supports} if name}

    def reset(self, env_ids: Array) -> None:
        if not self._order:
            return
        poses = np.stack([self._place(int(env)) for env in env_ids])
        free = self._roots[self._free]
        if len(free):
            self.engine.set_body_state(poses[:, self._free], np.zeros((len(env_ids), len(free), 6)), env_ids, free)
        fixed = self._roots[~self._free]
        if len(fixed):
            self.engine.set_body_state(poses[:, ~self._free], None, env_ids, fixed)

    def overridable(self) -> list[Overridable]:
        entries: list[Overridable] = []
        for name in self._order:
            entry = self.spec.world.layout[name]
            place = ("position",) if entry.on is None else ("x", "y")
            entries += drawn(f"{WORLD}layout.{name}", entry, (*place, "roll", "pitch", "yaw"))
        return entries

    def _place(self, env: int) -> Array:
        """Poses (K, 7) of the placed objects of one env, in `_order`."""
        placed: dict[str, Array] = {}
        for name in self._order:
            entry = self.spec.world.layout[name]
            for attempt in range(ATTEMPTS):
                pose = self._draw_pose(env, name, entry, placed, attempt)
                crowding = self._crowding(name, entry, pose, placed)
                if crowding is None:
                    placed[name] = pose
                    break
            else:
                raise TaskError(
                    f"env {env}: no place for '{name}' in {ATTEMPTS} draws that keeps its clearance of "
                    f"{entry.clearance:g} m from '{crowding}'; widen world.layout.{name} or lower its clearance"
                )
        return np.stack([placed[name] for name in self._order])

    def _draw_pose(self, env: int, name: str, entry: PlacementSpec, placed: dict[str, Array], attempt: int) -> Array:
        def value(field: str) -> float:
            return self._draw(env, name, entry, field, attempt)

        turn = P.from_roll_pitch_yaw(np.array([value("roll"), value("pitch"), value("yaw")]))
        if entry.on is None:
            position = self._draw(env, name, entry, "position", attempt)
            return np.concatenate([np.asarray(position, dtype=float), turn])
        shape, x, y = self._shapes[name], value("x"), value("y")
        if entry.on == GROUND:
            low, high = shape.bounds(np.concatenate([[x, y, 0.0], turn]))
            top = ground_top(self._world, low[:2], high[:2])
        else:
            top = self._shapes[entry.on].top_height(placed[entry.on])
        return shape.resting_on(top, np.asarray(x), np.asarray(y), turn)

    def _draw(self, env: int, name: str, entry: PlacementSpec, field: str, attempt: int) -> Any:
        source = f"world.layout.{name}.{field}"
        return draw(getattr(entry, field), f"layout/{name}/{field}", self.streams, env, attempt, source=source)

    def _crowding(self, name: str, entry: PlacementSpec, pose: Array, placed: dict[str, Array]) -> str | None:
        """The first placed object that is nearer than the clearance, measured between balls around both."""
        if entry.clearance <= 0:
            return None
        for other, theirs in placed.items():
            if other == entry.on:
                continue
            gap = float(P.norm(pose[:3] - theirs[:3])) - self._shapes[name].radius - self._shapes[other].radius
            if gap < entry.clearance:
                return other
        return None

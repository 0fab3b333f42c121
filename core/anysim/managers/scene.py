"""SceneManager: what each object is in this episode: mass, friction, colour."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.managers.base import Manager
from anysim.managers.overrides import WORLD, Overridable, revert, written
from anysim.managers.values import draw, draw_rows, is_random
from anysim.world.colors import rgb
from anysim.world.model import BodyKind, World
from anysim.world.nominal import nominal
from anysim_schemas.objects import ObjectSpec

PARAMETERS_OF: Mapping[str, Sequence[str]] = {
    "mass": ("body.mass", "body.inertia"),
    "density": ("body.mass", "body.inertia"),
    "friction": ("geom.friction",),
    "color": ("geom.color",),
}
"""The engine's parameters that a field of an object writes."""
GRAVITY = "physics.gravity"


class SceneManager(Manager):
    """Draws the random fields of objects and writes them as parameters; constant fields are in the World already."""

    name = "scene"

    def build(self, world: World) -> None:
        self._world = world
        self._objects: dict[str, ObjectSpec] = {}
        self._random: list[tuple[str, str]] = []
        """(object, field) of all that is drawn."""
        known = {entity.name for entity in world.entities}
        for name, obj in self.spec.world.objects.items():
            if name in known:
                self._objects[name] = obj
                self._random += [(name, field) for field in PARAMETERS_OF if is_random(getattr(obj, field))]

    def bind(self, engine: SimEngine) -> None:
        super().bind(engine)
        self._indices: dict[str, dict[str, Array]] = {}
        for name in self._objects:
            entity = engine.index.entity(name)
            self._indices[name] = {
                "bodies": np.arange(entity.body_start, entity.body_stop),
                "geoms": np.array(engine.index.geoms_of(entity), dtype=int),
            }

    def reset(self, env_ids: Array) -> None:
        for name, field in self._random:
            value, stream = getattr(self._objects[name], field), f"scene/{name}/{field}"
            source = f"{WORLD}objects.{name}.{field}"
            if field == "color":
                rows = np.array([rgb(draw(value, stream, self.streams, int(e), source=source)) for e in env_ids])
            else:
                rows = draw_rows(value, stream, self.streams, env_ids, source=source)
            self._write(name, field, rows, env_ids)

    def _write(self, name: str, field: str, rows: Array, env_ids: Array) -> None:
        """Write a field of an object for each env: (E,), or (E, 3) for colours."""
        if field in ("mass", "density"):
            self._write_mass(name, field, rows, env_ids)
            return
        geoms = self._indices[name]["geoms"]
        if field == "color":
            rows = np.concatenate([rows, np.ones((len(rows), 1))], axis=1)
        self.engine.set_parameters(
            PARAMETERS_OF[field][0], np.repeat(rows[:, None], len(geoms), axis=1), env_ids, geoms
        )

    def _write_mass(self, name: str, field: str, rows: Array, env_ids: Array) -> None:
        """Scale masses and inertias of all the object's bodies alike, so that its shape stays what it was."""
        bodies = self._indices[name]["bodies"]
        inertials = [self._world.bodies[b].inertial for b in bodies]
        masses = np.array([i.mass for i in inertials])
        if self._world.bodies[bodies[0]].kind is BodyKind.STATIC and not masses.sum():
            return
        obj = self._objects[name]
        ratio = rows / (masses.sum() if field == "mass" else nominal(obj.density))
        self.engine.set_parameters("body.mass", ratio[:, None] * masses, env_ids, bodies)
        inertia = np.array([i.inertia for i in inertials])
        self.engine.set_parameters("body.inertia", ratio[:, None, None] * inertia, env_ids, bodies)

    # ------------------------------------------------------------------ counterfactuals

    def overridable(self) -> list[Overridable]:
        entries = written("physics", self.spec.physics, {"gravity": ("world.gravity",)})
        for name, obj in self._objects.items():
            mass = "mass" if obj.density is None else "density"
            fields = {f: p for f, p in PARAMETERS_OF.items() if f not in ("mass", "density") or f == mass}
            entries += written(f"{WORLD}objects.{name}", obj, fields)
        return entries

    def override(self, path: str, value: Any, env_ids: Array) -> None:
        if path == GRAVITY:
            self.engine.set_parameters("world.gravity", np.tile(value, (len(env_ids), 1, 1)), env_ids)
            return
        _, name, field = path.split(".")
        row = rgb(value) if field == "color" else value
        self._write(name, field, np.repeat(np.array([row], dtype=float), len(env_ids), axis=0), env_ids)

    def revert(self, path: str, env_ids: Array) -> None:
        if path == GRAVITY:
            revert(self.engine, ["world.gravity"], env_ids, {"world": np.array([0])})
            return
        _, name, field = path.split(".")
        revert(self.engine, PARAMETERS_OF[field], env_ids, self._indices[name])

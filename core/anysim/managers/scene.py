"""SceneManager: what each object is in this episode: mass, friction, colour."""

from collections.abc import Iterable, Mapping

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.managers.base import Manager
from anysim.managers.values import draw, draw_rows, is_random
from anysim.world.colors import rgb
from anysim.world.forms import INSTANCER
from anysim.world.model import BodyKind, Entity, World
from anysim.world.nominal import nominal
from anysim.world.slots import ABSENT, active_entity
from anysim_schemas.objects import ObjectSpec

_PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "mass": ("body.mass", "body.inertia"), "density": ("body.mass", "body.inertia"),
    "friction": ("geom.friction",), "color": ("geom.color",),
}  # fmt: skip
"""What is written where a field is drawn."""


class SceneManager(Manager):
    """Draws the random fields of objects and writes them as parameters; constant fields are in the World already."""

    name = "scene"

    def build(self, world: World) -> None:
        self._world = world
        random = {
            name: obj
            for name, obj in self.spec.world.objects.items()
            if any(is_random(v) for v in (obj.mass, obj.density, obj.friction, obj.color))
        }
        self._random: dict[str, ObjectSpec] = {
            name: self.spec.world.objects[slot.category]
            for name, slot in world.logical_objects.items()
            if slot.category in random
        }

    def parameters(self) -> Iterable[tuple[str, str]]:
        for name, obj in self._random.items():
            for field, names in _PARAMETERS.items():
                if is_random(getattr(obj, field)):
                    yield from ((parameter, f"world.objects.{name}.{field}") for parameter in names)

    def bind(self, engine: SimEngine) -> None:
        super().bind(engine)
        self._bodies: dict[str, list[Array]] = {}
        self._geoms: dict[str, Array] = {}
        for name in self._random:
            # of all that it can be: parameters wait for what is absent
            entities = [self._world.entities[e] for e in sorted(self._world.logical_objects[name].entities)]
            self._bodies[name] = [np.arange(e.body_start, e.body_stop) for e in entities]
            self._geoms[name] = np.array([g for e in entities for g in engine.index.geoms_of(e)], dtype=int)

    def reset(self, env_ids: Array) -> None:
        presence, every = self.engine.presence, env_ids
        for name, obj in self._random.items():
            there = active_entity(self._world.logical_objects[name], presence[every]) != ABSENT
            env_ids = every[there]  # what is absent is not drawn for
            if len(env_ids) == 0:
                continue
            if is_random(obj.mass) or is_random(obj.density):
                self._write_mass(name, obj, env_ids)
            if is_random(obj.friction):
                rows = self._drawn(name, "friction", env_ids)
                self._write_geoms("geom.friction", name, rows[:, None], env_ids)
            if is_random(obj.color):
                self._write_color(name, obj, env_ids)

    def _write_mass(self, name: str, obj: ObjectSpec, env_ids: Array) -> None:
        """Scale masses and inertias of all the object's bodies alike, so that its shape stays what it was."""
        drawn = self._drawn(name, "mass" if is_random(obj.mass) else "density", env_ids)
        for bodies in self._bodies[name]:
            inertials = [self._world.bodies[b].inertial for b in bodies]
            masses = np.array([i.mass for i in inertials])
            if self._world.bodies[bodies[0]].kind is BodyKind.STATIC and not masses.sum():
                continue
            # of an instancer each body has the mass
            total = masses[0] if self._entity_of(bodies).family == INSTANCER else masses.sum()
            ratio = drawn / (total if is_random(obj.mass) else nominal(obj.density))
            self.engine.set_parameters("body.mass", ratio[:, None] * masses, env_ids, bodies)
            inertia = np.array([i.inertia for i in inertials])
            self.engine.set_parameters("body.inertia", ratio[:, None, None] * inertia, env_ids, bodies)

    def _entity_of(self, bodies: Array) -> Entity:
        return self._world.entities[self._world.body_entity[bodies[0]]]

    def _write_color(self, name: str, obj: ObjectSpec, env_ids: Array) -> None:
        source = f"{self._path(name)}.color"
        rows = [rgb(draw(obj.color, f"scene/{name}/color", self.streams, int(e), source=source)) for e in env_ids]
        self._write_geoms("geom.color", name, np.array([[[*c, 1.0]] for c in rows]), env_ids)

    def _drawn(self, name: str, field: str, env_ids: Array) -> Array:
        """One draw of an object's field for each env."""
        value, source = getattr(self._random[name], field), f"{self._path(name)}.{field}"
        return draw_rows(value, f"scene/{name}/{field}", self.streams, env_ids, source=source)

    def _path(self, name: str) -> str:
        return f"world.objects.{self._world.logical_objects[name].category}"

    def _write_geoms(self, parameter: str, name: str, rows: Array, env_ids: Array) -> None:
        geoms = self._geoms[name]
        self.engine.set_parameters(parameter, np.repeat(rows, len(geoms), axis=1), env_ids, geoms)

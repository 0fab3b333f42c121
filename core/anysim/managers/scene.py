"""SceneManager: what each object is in this episode: mass, friction, colour."""

from collections.abc import Iterable, Mapping

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.managers.base import Manager
from anysim.managers.values import draw, draw_rows, is_random
from anysim.world.colors import rgb
from anysim.world.model import BodyKind, World
from anysim.world.nominal import nominal
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
        self._random: dict[str, ObjectSpec] = random

    def parameters(self) -> Iterable[tuple[str, str]]:
        for name, obj in self._random.items():
            for field, names in _PARAMETERS.items():
                if is_random(getattr(obj, field)):
                    yield from ((parameter, f"world.objects.{name}.{field}") for parameter in names)

    def bind(self, engine: SimEngine) -> None:
        super().bind(engine)
        self._bodies: dict[str, Array] = {}
        self._geoms: dict[str, Array] = {}
        for name in self._random:
            entity = engine.index.entity(name)
            self._bodies[name] = np.arange(entity.body_start, entity.body_stop)
            self._geoms[name] = np.array(engine.index.geoms_of(entity), dtype=int)

    def reset(self, env_ids: Array) -> None:
        for name, obj in self._random.items():
            if is_random(obj.mass) or is_random(obj.density):
                self._write_mass(name, obj, env_ids)
            if is_random(obj.friction):
                rows = self._drawn(name, "friction", env_ids)
                self._write_geoms("geom.friction", name, rows[:, None], env_ids)
            if is_random(obj.color):
                self._write_color(name, obj, env_ids)

    def _write_mass(self, name: str, obj: ObjectSpec, env_ids: Array) -> None:
        """Scale masses and inertias of all the object's bodies alike, so that its shape stays what it was."""
        bodies = self._bodies[name]
        inertials = [self._world.bodies[b].inertial for b in bodies]
        masses = np.array([i.mass for i in inertials])
        if self._world.bodies[bodies[0]].kind is BodyKind.STATIC and not masses.sum():
            return
        if is_random(obj.mass):
            ratio = self._drawn(name, "mass", env_ids) / masses.sum()
        else:
            ratio = self._drawn(name, "density", env_ids) / nominal(obj.density)
        self.engine.set_parameters("body.mass", ratio[:, None] * masses, env_ids, bodies)
        inertia = np.array([i.inertia for i in inertials])
        self.engine.set_parameters("body.inertia", ratio[:, None, None] * inertia, env_ids, bodies)

    def _write_color(self, name: str, obj: ObjectSpec, env_ids: Array) -> None:
        source = f"world.objects.{name}.color"
        rows = [rgb(draw(obj.color, f"scene/{name}/color", self.streams, int(e), source=source)) for e in env_ids]
        self._write_geoms("geom.color", name, np.array([[[*c, 1.0]] for c in rows]), env_ids)

    def _drawn(self, name: str, field: str, env_ids: Array) -> Array:
        """One draw of an object's field for each env."""
        value, source = getattr(self._random[name], field), f"world.objects.{name}.{field}"
        return draw_rows(value, f"scene/{name}/{field}", self.streams, env_ids, source=source)

    def _write_geoms(self, parameter: str, name: str, rows: Array, env_ids: Array) -> None:
        geoms = self._geoms[name]
        self.engine.set_parameters(parameter, np.repeat(rows, len(geoms), axis=1), env_ids, geoms)

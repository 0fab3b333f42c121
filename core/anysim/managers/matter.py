"""From the fields of an object to the parameters of an engine: one rule for each parameter, in a table."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from anysim.compile.appearance import by_name, material_name, texture_name, tint
from anysim.compile.variants import INSTANCER
from anysim.conventions import Array
from anysim.model.colors import rgb
from anysim.model.world import BodyKind, World
from anysim.randomization.distributions import nominal
from anysim_schemas.objects import ObjectSpec

Drawn = Mapping[str, Sequence[Any]]
"""For each field what it is in each of E envs; None where the spec does not give it."""


@dataclass(frozen=True)
class Part:
    """An entity that parameters are written to."""

    world: World
    bodies: Array
    geoms: Array
    shown: Array
    roots: Array

    @classmethod
    def of(cls, world: World, entity: int) -> "Part":
        """The entity by its index."""
        thing = world.entities[entity]
        own = range(thing.body_start, thing.body_stop)
        geoms = [i for i, geom in enumerate(world.geoms) if geom.body in own]
        shown = [i for i in geoms if world.geoms[i].visible]
        bodies = np.array(own)
        roots = bodies if thing.family == INSTANCER else bodies[:1]
        return cls(world, bodies, np.array(geoms, dtype=int), np.array(shown, dtype=int), roots)

    def indices(self, parameter: str) -> Array:
        """Where a parameter is written: all bodies of the entity or its roots, all its geoms or those that are seen."""
        if parameter in ("geom.color", "geom.texture", "geom.material"):
            return self.shown
        if parameter.startswith("geom."):
            return self.geoms
        return self.bodies if parameter in ("body.mass", "body.inertia") else self.roots

    @property
    def masses(self) -> Array:
        """(B,) [kg] as compiled; all 0 for something fixed that has none."""
        return np.array([self.world.bodies[b].inertial.mass for b in self.bodies])

    @property
    def mass(self) -> float:
        """What a spec calls its mass [kg]: that of all its bodies, or of each body of an instancer."""
        return float(self.masses.sum()) / (len(self.roots) if len(self.bodies) else 1)


Rows = Array | None
"""Values (E, K, ...) for the indices of a part; None where there is nothing to write."""


class Rule(NamedTuple):
    """A parameter, the fields of an ObjectSpec that it follows from (dotted), and how; what else it reads of them."""

    parameter: str
    fields: tuple[str, ...]
    rows: Callable[[Part, ObjectSpec, Drawn], Rows]
    reads: tuple[str, ...] = ()


def owner_of(spec: ObjectSpec, field: str) -> tuple[Any, str]:
    """The part of an ObjectSpec that a field is in, None where the spec does not give it, and the field's key there."""
    within, _, key = field.rpartition(".")
    return (getattr(spec, within) if within else spec), key


def field_of(spec: ObjectSpec, field: str) -> Any:
    """A field by its dotted name, as something to be drawn: textures and materials by their names."""
    holder, key = owner_of(spec, field)
    value = None if holder is None else getattr(holder, key)
    if field == "texture" and value is not None:
        return by_name(value, texture_name)
    if field == "material" and value is not None:
        return by_name(value, material_name)
    return value


def _column(drawn: Drawn, field: str) -> Array:
    return np.array(drawn[field], dtype=float)


def _heavier(part: Part, spec: ObjectSpec, drawn: Drawn) -> Array | None:
    """(E,) by what factor all masses change, so that the object's shape stays what it was."""
    total = part.mass
    if part.world.bodies[part.bodies[0]].kind is BodyKind.STATIC and not total:
        return None
    if spec.density is not None:
        return _column(drawn, "density") / float(nominal(spec.density))
    return np.array([1.0 if mass is None else mass / total for mass in drawn["mass"]])


def _mass(part: Part, spec: ObjectSpec, drawn: Drawn) -> Rows:
    ratio = _heavier(part, spec, drawn)
    return None if ratio is None else ratio[:, None] * part.masses


def _inertia(part: Part, spec: ObjectSpec, drawn: Drawn) -> Rows:
    ratio = _heavier(part, spec, drawn)
    if ratio is None:
        return None
    if drawn["inertia_scale"][0] is not None:
        ratio = ratio * (_column(drawn, "inertia_scale") / float(nominal(spec.inertia_scale or 1.0)))
    return ratio[:, None, None] * np.array([part.world.bodies[b].inertial.inertia for b in part.bodies])


def _com(part: Part, spec: ObjectSpec, drawn: Drawn) -> Rows:
    built = np.array([part.world.bodies[b].inertial.com for b in part.roots]) - np.array(
        nominal(spec.com_offset or 0.0)
    )
    return built + _column(drawn, "com_offset")[:, None]


def _root(field: str) -> Callable[[Part, ObjectSpec, Drawn], Rows]:
    return lambda part, spec, drawn: np.repeat(_column(drawn, field)[:, None], len(part.roots), axis=1)


def _surface(field: str) -> Callable[[Part, ObjectSpec, Drawn], Rows]:
    return lambda part, spec, drawn: np.repeat(_column(drawn, field)[:, None], len(part.geoms), axis=1)


def _look(field: str, things: str) -> Callable[[Part, ObjectSpec, Drawn], Rows]:
    def rows(part: Part, spec: ObjectSpec, drawn: Drawn) -> Rows:
        table = {thing.name: i for i, thing in enumerate(getattr(part.world, things))}
        return np.repeat(np.array([[float(table[name])] for name in drawn[field]]), len(part.shown), axis=1)

    return rows


def _color(part: Part, spec: ObjectSpec, drawn: Drawn) -> Rows:
    """The colour over the texture's white over the material's; opacity is the material's."""
    materials = {material.name: material for material in part.world.materials}
    built = np.array([part.world.geoms[g].color for g in part.shown]).reshape(-1, 4)
    rows = np.repeat(built[None], len(drawn["color"]), axis=0)
    for row, color, texture, name in zip(rows, drawn["color"], drawn["texture"], drawn["material"], strict=True):
        material = None if name is None else materials[name]
        chosen = tint(None if color is None else rgb(color), texture is not None, material)
        if chosen is not None:
            row[:, :3] = chosen
        if material is not None:
            row[:, 3] = material.opacity
    return rows


RULES: tuple[Rule, ...] = (
    Rule("body.mass", ("mass", "density"), _mass),
    Rule("body.inertia", ("mass", "density", "inertia_scale"), _inertia),
    Rule("body.com", ("com_offset",), _com),
    Rule("body.linear_damping", ("damping.linear",), _root("damping.linear")),
    Rule("body.angular_damping", ("damping.angular",), _root("damping.angular")),
    Rule("geom.friction", ("friction",), _surface("friction")),
    Rule("geom.restitution", ("restitution",), _surface("restitution")),
    Rule("geom.color", ("color", "material"), _color, ("texture",)),
    Rule("geom.texture", ("texture",), _look("texture", "textures")),
    Rule("geom.material", ("material",), _look("material", "materials")),
)
"""In the order in which they are written."""

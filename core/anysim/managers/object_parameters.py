"""Object parameters: what each object is in this episode: its mass, its surface, how it is damped, how it looks.

A table says which parameters of an engine follow from which fields of an object, and how.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from anysim.compile.appearance import by_name, material_name, texture_name, tint
from anysim.compile.variants import INSTANCER
from anysim.conventions import Array
from anysim.managers.base import WORLD, Manager, Overridable, revert
from anysim.model.appearance import rgb
from anysim.model.world import BodyKind, World
from anysim.randomization.distributions import nominal
from anysim.randomization.draw import draw, is_random
from anysim_schemas.objects import ObjectSpec

DrawnValues = Mapping[str, Sequence[Any]]
"""For each field what it is in each of E envs; None where the spec does not give it."""


@dataclass(frozen=True)
class EntityIndices:
    """The bodies and geoms of an entity that parameters are written to; `shown` are the visible geoms."""

    world: World
    bodies: Array
    geoms: Array
    shown: Array
    roots: Array

    @classmethod
    def of(cls, world: World, entity: int) -> "EntityIndices":
        """The entity by its index."""
        thing = world.entities[entity]
        own = range(thing.body_start, thing.body_stop)
        geoms = sorted(geom for body in own for geom in world.body_geoms[body])
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
    rows: Callable[[EntityIndices, ObjectSpec, DrawnValues], Rows]
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


def _column(drawn: DrawnValues, field: str) -> Array:
    return np.array(drawn[field], dtype=float)


def _heavier(part: EntityIndices, spec: ObjectSpec, drawn: DrawnValues) -> Array | None:
    """(E,) by what factor all masses change, so that the object's shape stays what it was."""
    total = part.mass
    if part.world.bodies[part.bodies[0]].kind is BodyKind.STATIC and not total:
        return None
    if spec.density is not None:
        return _column(drawn, "density") / float(nominal(spec.density))
    return np.array([1.0 if mass is None else mass / total for mass in drawn["mass"]])


def _mass(part: EntityIndices, spec: ObjectSpec, drawn: DrawnValues) -> Rows:
    ratio = _heavier(part, spec, drawn)
    return None if ratio is None else ratio[:, None] * part.masses


def _inertia(part: EntityIndices, spec: ObjectSpec, drawn: DrawnValues) -> Rows:
    ratio = _heavier(part, spec, drawn)
    if ratio is None:
        return None
    if drawn["inertia_scale"][0] is not None:
        ratio = ratio * (_column(drawn, "inertia_scale") / float(nominal(spec.inertia_scale or 1.0)))
    return ratio[:, None, None] * np.array([part.world.bodies[b].inertial.inertia for b in part.bodies])


def _com(part: EntityIndices, spec: ObjectSpec, drawn: DrawnValues) -> Rows:
    built = np.array([part.world.bodies[b].inertial.com for b in part.roots]) - np.array(
        nominal(spec.com_offset or 0.0)
    )
    return built + _column(drawn, "com_offset")[:, None]


def _root(field: str) -> Callable[[EntityIndices, ObjectSpec, DrawnValues], Rows]:
    return lambda part, spec, drawn: np.repeat(_column(drawn, field)[:, None], len(part.roots), axis=1)


def _surface(field: str) -> Callable[[EntityIndices, ObjectSpec, DrawnValues], Rows]:
    return lambda part, spec, drawn: np.repeat(_column(drawn, field)[:, None], len(part.geoms), axis=1)


def _look(field: str, things: str) -> Callable[[EntityIndices, ObjectSpec, DrawnValues], Rows]:
    def rows(part: EntityIndices, spec: ObjectSpec, drawn: DrawnValues) -> Rows:
        table = {thing.name: i for i, thing in enumerate(getattr(part.world, things))}
        return np.repeat(np.array([[float(table[name])] for name in drawn[field]]), len(part.shown), axis=1)

    return rows


def _color(part: EntityIndices, spec: ObjectSpec, drawn: DrawnValues) -> Rows:
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

FIELDS = tuple(dict.fromkeys(field for rule in RULES for field in rule.fields))
PAINTED = ("texture", "material")
"""What is painted on an object is part of the World: an episode has one of what its spec names."""


class _Thing(NamedTuple):
    """A logical object.

    `values` are its fields as they are drawn, `rules` those that a drawn field makes act, `parts` the entities that it
    can be, by their indices.
    """

    name: str
    category: str
    spec: ObjectSpec
    values: Mapping[str, Any]
    rules: tuple[Rule, ...]
    parts: Mapping[int, EntityIndices]


class SceneManager(Manager):
    """Draws the random fields of objects and writes them as parameters; constant fields are in the World already.

    Each logical object draws for itself, where it is there; what is drawn is written to the entity that it is in that
    env.
    """

    name = "scene"

    def build(self, world: World) -> None:
        self._things = [thing for name, spec in self.spec.world.objects.items() for thing in _things(world, name, spec)]

    def parameters(self) -> Iterable[tuple[str, str]]:
        for name, spec in self.spec.world.objects.items():
            for rule in RULES:
                for field in rule.fields:
                    if is_random(field_of(spec, field)):
                        yield rule.parameter, f"{WORLD}objects.{name}.{field}"

    def reset(self, env_ids: Array) -> None:
        for thing in self._things:
            if thing.rules:
                self._write(thing, thing.rules, env_ids)

    def _write(self, thing: _Thing, rules: Iterable[Rule], env_ids: Array) -> None:
        """Draw an object's fields for the envs where it is there, and write what follows from them by some rules."""
        present = self.engine.presence[env_ids]
        there = np.flatnonzero(present[:, list(thing.parts)].any(axis=1))
        drawn = self._draw(thing, rules, env_ids[there])
        for entity, part in thing.parts.items():
            rows = np.flatnonzero(present[there, entity])
            if not len(rows):
                continue
            own = {field: [values[row] for row in rows] for field, values in drawn.items()}
            for rule in rules:
                values = rule.rows(part, thing.spec, own)
                if values is not None:
                    ids = env_ids[there[rows]]
                    self.engine.set_parameters(rule.parameter, values, ids, part.indices(rule.parameter))

    def _draw(self, thing: _Thing, rules: Iterable[Rule], env_ids: Array) -> dict[str, list[Any]]:
        """The values of the fields that rules read, one an env: constants too, None where the spec gives nothing."""
        read = {field for rule in rules for field in (*rule.fields, *rule.reads)}
        return {
            field: [
                draw(
                    value,
                    f"scene/{thing.name}/{field}",
                    self.streams,
                    int(env),
                    source=f"{WORLD}objects.{thing.category}.{field}",
                )
                for env in env_ids
            ]
            for field, value in thing.values.items()
            if field in read
        }

    # ------------------------------------------------------------------ counterfactuals

    def overridable(self) -> list[Overridable]:
        """All that is a number or a colour; of mass and density the one that counts."""
        entries: list[Overridable] = []
        for name, spec in self.spec.world.objects.items():
            unused = "density" if spec.density is None else "mass"
            for field in FIELDS:
                holder, key = owner_of(spec, field)
                if holder is not None and field not in (*PAINTED, unused):
                    names = tuple(rule.parameter for rule in RULES if field in rule.fields)
                    entries.append(Overridable(f"{WORLD}objects.{name}.{field}", holder, key, names, midway=True))
        return entries

    def override(self, path: str, value: Any, env_ids: Array) -> None:
        """Write what follows from the field; its value is what `draw` gives from now on."""
        for thing, rules in self._named(path):
            self._write(thing, rules, env_ids)

    def revert(self, path: str, env_ids: Array) -> None:
        for thing, rules in self._named(path):
            for rule in rules:
                for part in thing.parts.values():
                    own = part.indices(rule.parameter)
                    revert(self.engine, [rule.parameter], env_ids, {"bodies": own, "geoms": own})

    def _named(self, path: str) -> Iterable[tuple[_Thing, list[Rule]]]:
        """The objects that a path such as `objects.cube.friction` is of, and the rules that its field makes act."""
        _, name, field = path.split(".", 2)
        rules = [rule for rule in RULES if field in rule.fields]
        return [(thing, rules) for thing in self._things if thing.category == name]


def _things(world: World, name: str, spec: ObjectSpec) -> list[_Thing]:
    """The logical objects of an entry of the spec: one, or its instances."""
    values = {field: field_of(spec, field) for field in FIELDS}
    rules = tuple(rule for rule in RULES if any(is_random(values[field]) for field in rule.fields))
    slots = {one: slot.entities for one, slot in world.logical_objects.items() if slot.category == name}
    return [
        _Thing(slot, name, spec, values, rules, {e: EntityIndices.of(world, e) for e in entities})
        for slot, entities in slots.items()
    ]

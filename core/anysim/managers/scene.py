"""SceneManager: what each object is in this episode: its mass, its surface, how it is damped, how it looks."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.managers.base import Manager
from anysim.managers.matter import RULES, Part, Rule, field_of, owner_of
from anysim.managers.overrides import WORLD, Overridable, revert
from anysim.model.world import World
from anysim.randomization.draw import draw, is_random
from anysim_schemas.objects import ObjectSpec

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
    parts: Mapping[int, Part]


class SceneManager(Manager):
    """Draws the random fields of objects and writes them as parameters; constant fields are in the World already.

    Each logical object draws for itself, where it is there; what is drawn is written to the entity that it is in that
    env. Which parameters a field ends up in, and how, is in `anysim.managers.matter`.
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
        _Thing(slot, name, spec, values, rules, {e: Part.of(world, e) for e in entities})
        for slot, entities in slots.items()
    ]

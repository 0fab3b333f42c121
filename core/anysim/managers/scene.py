"""SceneManager: what each object is in this episode: its mass, its surface, how it is damped, how it looks."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.managers.base import Manager
from anysim.managers.matter import RULES, Part, Rule, field_of
from anysim.managers.values import draw, is_random
from anysim.world.model import World
from anysim_schemas.objects import ObjectSpec

FIELDS = tuple(dict.fromkeys(field for rule in RULES for field in rule.fields))


class _Thing(NamedTuple):
    """A logical object of which something is drawn.

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
                        yield rule.parameter, f"world.objects.{name}.{field}"

    def reset(self, env_ids: Array) -> None:
        present = self.engine.presence[env_ids]
        for thing in self._things:
            there = np.flatnonzero(present[:, list(thing.parts)].any(axis=1))
            drawn = self._draw(thing, env_ids[there])
            for entity, part in thing.parts.items():
                rows = np.flatnonzero(present[there, entity])
                if not len(rows):
                    continue
                own = {field: [values[row] for row in rows] for field, values in drawn.items()}
                for rule in thing.rules:
                    values = rule.rows(part, thing.spec, own)
                    if values is not None:
                        ids = env_ids[there[rows]]
                        self.engine.set_parameters(rule.parameter, values, ids, part.indices(rule.parameter))

    def _draw(self, thing: _Thing, env_ids: Array) -> dict[str, list[Any]]:
        """The values of all fields, one an env: constants too, and None where the spec gives nothing."""
        return {
            field: [
                draw(
                    value, f"scene/{thing.name}/{field}", self.streams, int(env),
                    source=f"world.objects.{thing.category}.{field}",
                )
                for env in env_ids
            ]
            for field, value in thing.values.items()
        }  # fmt: skip


def _things(world: World, name: str, spec: ObjectSpec) -> list[_Thing]:
    """The logical objects of an entry of the spec that has anything to draw: its slots, or the one of that name."""
    values = {field: field_of(spec, field) for field in FIELDS}
    rules = tuple(rule for rule in RULES if any(is_random(values[field]) for field in rule.fields))
    if not rules:
        return []
    slots = {one: slot.entities for one, slot in world.logical_objects.items() if slot.category == name}
    return [
        _Thing(slot, name, spec, values, rules, {e: Part.of(world, e) for e in entities})
        for slot, entities in slots.items()
    ]

"""PopulationManager: how many of each object are there in this episode, and which of its sources and sizes."""

from typing import NamedTuple

import numpy as np

from anysim.compile.variants import INSTANCER, Options, counts, drawn_sources, sizes, source_text
from anysim.conventions import Array
from anysim.managers.base import Manager
from anysim.model.world import World
from anysim.randomization.draw import draw
from anysim_schemas.object_source import SourceChoice
from anysim_schemas.objects import ObjectSpec


class _Member(NamedTuple):
    """One logical object: its name and the entities (sources, sizes) that it can be."""

    name: str
    entities: Array


class _Group(NamedTuple):
    """What one declaration of the spec makes, and how it is drawn."""

    name: str
    number: Options | None
    sources: Options
    sizes: Options
    members: tuple[_Member, ...]


class PopulationManager(Manager):
    """Draws numbers, sources and sizes, and has the engine change what is there in the envs where that differs."""

    name = "population"

    def build(self, world: World) -> None:
        self._nominal = world.initial_presence
        made = [_group(world, name, spec) for name, spec in self.spec.world.objects.items()]
        self._groups = [group for group in made if group is not None]

    def reset(self, env_ids: Array) -> None:
        if not self._groups:
            return
        wanted = np.stack([self._draw(int(env)) for env in env_ids])
        other = (self.engine.presence[env_ids] != wanted).any(axis=1)
        if other.any():
            self.engine.reset(env_ids[other], present=wanted[other])

    def _draw(self, env: int) -> Array:
        """The entities that are there in an env (entities,) bool."""
        there = self._nominal.copy()
        for group in self._groups:
            path = f"world.objects.{group.name}"
            number = len(group.members)
            if group.number is not None:
                stream = f"population/{group.name}/count"
                number = int(draw(group.number.drawn, stream, self.streams, env, source=f"{path}.count"))
            for i, member in enumerate(group.members):
                there[member.entities.ravel()] = False
                if i >= number:
                    continue
                one = [0, 0]
                for axis, (field, among) in enumerate((("source", group.sources), ("scale", group.sizes))):
                    if among.drawn is not None:
                        stream = f"population/{member.name}/{field}"
                        found = draw(among.drawn, stream, self.streams, env, source=f"{path}.{field}")
                        one[axis] = among.values.index(found)
                there[member.entities[one[0], one[1]]] = True
        return there


def _group(world: World, name: str, spec: ObjectSpec) -> _Group | None:
    """How a declaration is drawn; None where it is the same in every env."""
    slots = [slot for slot in world.slots if slot.category == name]
    if not slots:
        return None
    scales = sizes(spec)
    shape = (-1, len(scales.values))
    members = tuple(_Member(slot.name, np.reshape(sorted(slot.entities), shape)) for slot in slots)
    texts = [world.entities[entity].source for entity in members[0].entities[:, 0]]
    if isinstance(spec.source, SourceChoice):
        listed = [*spec.source.choice, *(() if spec.source.otherwise is None else (spec.source.otherwise,))]
        texts = [source_text(one) for one in listed[: len(texts)]]
    number = None if spec.count is None or spec.family == INSTANCER else counts(spec.count)
    number = None if number is None or number.drawn is None else number
    return _Group(name, number, drawn_sources(spec, texts), scales, members)

"""Randomized parameters: tables from the fields of a spec to the parameters of an engine, one field for one parameter.

Objects and robots, of which several fields make one parameter, have tables of their own: `object_parameters` and
`robot_parameters`.
"""

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from anysim.compile.joints import asked_of, opened_to
from anysim.conventions import Array
from anysim.managers.base import WORLD, Manager, Overridable, random_fields, revert
from anysim.model.appearance import rgb
from anysim.model.world import Joint, World
from anysim.randomization.draw import draw, is_random

GRAVITY = {"gravity": "world.gravity"}
LIGHT = {name: f"light.{name}" for name in ("direction", "position", "color", "intensity")}
SCENERY = {name: f"world.{name}" for name in ("background", "ambient", "shadows")}
JOINT = {"friction": "joint.friction", "damping": "joint.damping"}
"""Parameters by the field of the spec that gives them."""

JOINT_POSITION: Mapping[str, Callable[[Joint, float], float]] = {
    "initial": lambda joint, position: position,
    "opened": opened_to,
}
"""The position at which a joint begins, by the field of the spec that gives it."""

COLORS = ("light.color", "world.background", "world.ambient")
"""Parameters that a spec may give by a colour's name."""


class Field(NamedTuple):
    """A field of the spec that is drawn in each episode.

    Attributes:
        source: its dotted path.
        stream: the name of the stream that it is drawn from.
        value: the distribution.
        field: its key in the spec.
        parameter: the engine's parameter; None for a joint's position.
        index: that of the light or joint, None for a parameter of the whole world.
        entity: the entity that has to be there in an env, None where there is no such condition.
    """

    source: str
    stream: str
    value: Any
    field: str
    parameter: str | None
    index: int | None = None
    entity: int | None = None


class RandomizedParameters(Manager):
    """Draws the random fields of one part of the spec and writes them; constants are in the World already."""

    @abstractmethod
    def _found(self, world: World) -> Iterator[Field]:
        """The random fields, in the order in which they are drawn."""

    def build(self, world: World) -> None:
        self._world = world
        self._fields = list(self._found(world))

    def parameters(self) -> Iterable[tuple[str, str]]:
        return [(field.parameter, field.source) for field in self._fields if field.parameter is not None]

    def reset(self, env_ids: Array) -> None:
        """Draw for what is there in each env."""
        presence = self.engine.presence[env_ids] if any(field.entity is not None for field in self._fields) else None
        for field in self._fields:
            ids = env_ids if presence is None or field.entity is None else env_ids[presence[:, field.entity]]
            if not len(ids):
                continue
            drawn = [draw(field.value, field.stream, self.streams, env, source=field.source) for env in ids.tolist()]
            indices = None if field.index is None else [field.index]
            if field.parameter is not None:
                plain = [rgb(color) for color in drawn] if field.parameter in COLORS else drawn
                self.engine.set_parameters(field.parameter, np.array(plain, dtype=float)[:, None], ids, indices)
            elif field.index is not None:
                joint, position_of = self._world.joints[field.index], JOINT_POSITION[field.field]
                wanted = [position_of(joint, float(value)) for value in drawn]
                position = np.clip(np.array(wanted), joint.lower, joint.upper)[:, None]
                self.engine.set_joint_state(position, np.zeros_like(position), ids, indices)


class SceneParameterManager(RandomizedParameters):
    """How the joints of objects begin an episode and how they resist in it, and gravity."""

    name = "parameters"

    def _found(self, world: World) -> Iterator[Field]:
        for object_name in self.spec.world.objects:
            yield from self._joints(world, object_name)
        for key, parameter in GRAVITY.items():
            value = getattr(self.spec.physics, key)
            if is_random(value):
                yield Field(f"physics.{key}", f"physics/world/{key}", value, key, parameter)

    def _joints(self, world: World, name: str) -> Iterator[Field]:
        """Those of the joints of an entry of the spec: one object, or its instances, each as what it can be."""
        asked_for = self.spec.world.objects[name].joints
        if not asked_for:
            return
        members = [(slot.name, e) for slot in world.slots if name in (slot.name, slot.category) for e in slot.entities]
        alone = [(name, number) for number, entity in enumerate(world.entities) if entity.name == name]
        for thing, number in members or alone:
            entity = world.entities[number]
            for joint in range(entity.joint_start, entity.joint_stop):
                local = world.joints[joint].name.removeprefix(f"{entity.name}.")
                for key, asked in asked_of(asked_for, local).items():
                    if is_random(asked.value) and (key in JOINT or key in JOINT_POSITION):
                        source = f"{WORLD}objects.{name}.joints.{asked.key}.{key}"
                        stream = f"joints/{thing}/{local}/{key}"
                        yield Field(source, stream, asked.value, key, JOINT.get(key), joint, number)

    def overridable(self) -> list[Overridable]:
        return [Overridable(f"physics.{key}", self.spec.physics, key, (name,), True) for key, name in GRAVITY.items()]

    def override(self, path: str, value: Any, env_ids: Array) -> None:
        parameter = GRAVITY[path.rpartition(".")[2]]
        self.engine.set_parameters(parameter, np.tile(value, (len(env_ids), 1, 1)), env_ids)

    def revert(self, path: str, env_ids: Array) -> None:
        revert(self.engine, [GRAVITY[path.rpartition(".")[2]]], env_ids, {"world": np.array([0])})


class LightManager(RandomizedParameters):
    """Lights, and the background and the light of their surroundings."""

    name = "light"

    def _found(self, world: World) -> Iterator[Field]:
        index = {light.name: i for i, light in enumerate(world.lights)}
        for light, spec in self.spec.world.lights.items():
            for key, parameter in LIGHT.items():
                value = getattr(spec, key)
                if is_random(value):
                    source = f"{WORLD}lights.{light}.{key}"
                    yield Field(source, f"light/{light}/{key}", value, key, parameter, index[light])
        for key, parameter in SCENERY.items():
            value = getattr(self.spec.world.scenery, key)
            if is_random(value):
                yield Field(f"{WORLD}scenery.{key}", f"light/scenery.{key}", value, key, parameter)

    def overridable(self) -> list[Overridable]:
        world = self.spec.world
        lights = [e for name, light in world.lights.items() for e in random_fields(f"{WORLD}lights.{name}", light)]
        return lights + random_fields(f"{WORLD}scenery", world.scenery)

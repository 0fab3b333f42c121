"""JointManager: where the joints of objects begin an episode, and how they resist in it."""

from typing import NamedTuple

import numpy as np

from anysim.compile.joints import Asked, asked_of, opened_to
from anysim.conventions import Array
from anysim.managers.base import Manager
from anysim.model.world import World
from anysim.randomization.draw import draw_rows, is_random

_PARAMETERS = {"friction": "joint.friction", "damping": "joint.damping"}


class _Random(NamedTuple):
    """A field of a joint that is drawn anew in each episode."""

    object: str  # the key of `world.objects`
    thing: str  # the object itself; one of several where a key stands for several
    entity: int  # of the world
    joint: int  # of the world
    local: str  # as the object's spec calls it
    field: str
    asked: Asked


class JointManager(Manager):
    """Draws the random fields of objects' joints; what is constant is in the World, and every reset begins with it."""

    name = "joints"

    def build(self, world: World) -> None:
        self._world = world
        entities = {entity.name: i for i, entity in enumerate(world.entities)}
        slots = {slot.name: slot for slot in world.slots}
        self._random: list[_Random] = []
        for name, spec in self.spec.world.objects.items():
            if not spec.joints:
                continue
            members = [slot for slot in slots.values() if name in (slot.name, slot.category)]
            things = [(slot.name, e) for slot in members for e in slot.entities]
            if not members and name in entities:
                things = [(name, entities[name])]
            for thing, number in things:
                entity = world.entities[number]
                for joint in range(entity.joint_start, entity.joint_stop):
                    local = world.joints[joint].name.removeprefix(f"{entity.name}.")
                    self._random += [
                        _Random(name, thing, number, joint, local, field, asked)
                        for field, asked in asked_of(spec.joints, local).items()
                        if field != "limits" and is_random(asked.value)
                    ]

    def reset(self, env_ids: Array) -> None:
        """Positions at rest, and parameters, of what is there in each env."""
        if not self._random:
            return
        present = self.engine.presence[env_ids]
        for item in self._random:
            ids, joint = env_ids[present[:, item.entity]], self._world.joints[item.joint]
            if not len(ids):
                continue
            drawn = draw_rows(
                item.asked.value,
                f"joints/{item.thing}/{item.local}/{item.field}",
                self.streams,
                ids,
                source=f"world.objects.{item.object}.joints.{item.asked.key}.{item.field}",
            )
            if item.field in _PARAMETERS:
                self.engine.set_parameters(_PARAMETERS[item.field], drawn[:, None], ids, [item.joint])
                continue
            if item.field == "opened":
                drawn = np.array([opened_to(joint, float(share)) for share in drawn])
            position = np.clip(drawn, joint.lower, joint.upper)
            self.engine.set_joint_state(position[:, None], np.zeros((len(ids), 1)), ids, [item.joint])

"""Numbers of things and of their classes in readings: those of logical objects, whatever these are in each env."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.model.world import World


class Identities(NamedTuple):
    """What the numbers in readings mean; 0 is the ground, and where nothing is.

    Attributes:
        instances: the number of each object and robot, in the order of the World, from 1.
        classes: that of each label, the one of its file or else its category; in alphabetical order, from 1.
        instance, class_: (entities + 1,) int32, both for each segmentation id.
    """

    instances: dict[str, int]
    classes: dict[str, int]
    instance: Array
    class_: Array

    @classmethod
    def of(cls, world: World) -> "Identities":
        """Those of a World; equal in all envs, and the same as in the labels of cameras."""
        slots = list(world.logical_objects.values())
        labels = [world.entities[slot.entities[0]].label or slot.category for slot in slots]
        classes = {label: number for number, label in enumerate(sorted(set(labels)), 1)}
        instance, class_ = (np.zeros(len(world.entities) + 1, dtype=np.int32) for _ in range(2))
        for number, (slot, label) in enumerate(zip(slots, labels, strict=True), 1):
            rows = np.array(slot.entities) + 1
            instance[rows], class_[rows] = number, classes[label]
        return cls({slot.name: number for number, slot in enumerate(slots, 1)}, classes, instance, class_)

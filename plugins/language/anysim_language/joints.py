"""Movable parts of objects: their joints of two ends, and what is done to them by what their assets offer."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from anysim.model.world import World


class MovablePart(NamedTuple):
    """A joint of an object by its number, the name of the body that it moves, and its range [rad] or [m].

    `done` is `opened` for what is opened and closed again, else `turned` or `pressed`.
    """

    joint: int
    name: str
    lower: float
    upper: float
    done: str


def movable_parts(world: World, entity: int) -> Iterator[MovablePart]:
    """Those of an entity. Where its asset offers nothing to take hold of, all of them are there to be opened."""
    own = world.entities[entity]
    uses = {f"{own.name}.{one.joint}": set(one.use) for one in own.affordances if one.joint}
    for j in range(own.joint_start, own.joint_stop):
        joint = world.joints[j]
        if joint.mimic is not None or not np.isfinite([joint.lower, joint.upper]).all() or joint.lower >= joint.upper:
            continue
        use = uses.get(joint.name, set[str]() if own.affordances else {"open", "close"})
        closes = use >= {"open", "close"} and joint.lower >= 0.0  # what is in the middle of its range is not shut there
        done = "opened" if closes else "pressed" if "press" in use else "turned" if "turn" in use else ""
        if done:
            yield MovablePart(j, world.bodies[joint.body].name, joint.lower, joint.upper, done)

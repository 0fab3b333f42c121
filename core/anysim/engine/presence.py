"""Presence of a World's entities in each env, and how an engine makes them come and go.

A World lists everything that may ever be in an env; a slot of it says what is one and the same logical object with
another asset. Arrays stay dense over all entities, whatever an env has. It changes at a reset alone.
"""

from collections.abc import Callable, Iterator
from enum import StrEnum

import numpy as np

from anysim.conventions import Array
from anysim.errors import EngineError
from anysim.math.arrays import array
from anysim.model.index import paired
from anysim.model.world import World


class Lifecycle(StrEnum):
    """What an engine can do with an entity after the build (MagicSim report, section 4.5)."""

    P1 = "import and delete"
    P2 = "import only"  # what leaves is retired: hidden, disabled, moved aside, and taken up again
    P3 = "neither"  # everything stays and is reset in place

    @property
    def words(self) -> str:
        """As tables print it: `P1 (import and delete)`."""
        return f"{self.name} ({self.value})"


class Presence:
    """The entities of all envs: `entities` (N, E), and `bodies` (N, B) and `joints` (N, J) that follow from them."""

    def __init__(self, world: World, num_envs: int) -> None:
        self.world = world
        self.varies = bool(world.slots)
        """Whether anything may be absent at all."""
        body_entity = np.array(world.body_entity, dtype=int)
        joint_body = np.array([joint.body for joint in world.joints], dtype=int)
        self._body_entity, self._joint_entity = body_entity, body_entity[joint_body]
        self._initial_joints = np.array([joint.initial for joint in world.joints], dtype=float)
        self.entities = np.repeat(world.initial_presence[None], num_envs, axis=0)
        self._derive()

    def _derive(self) -> None:
        there = np.append(self.entities, np.ones((len(self.entities), 1), dtype=bool), axis=1)  # no entity's: index -1
        self.bodies, self.joints = there[:, self._body_entity], there[:, self._joint_entity]

    def checked(self, present: object, ids: Array) -> Array:
        """The wanted rows (E, entities), if every env has what is fixed and no slot has two entities.

        Raises:
            EngineError: another shape or type, or rows that no env can have.
        """
        rows, world = array("present", present, EngineError), self.world
        shape = (len(ids), len(world.entities))
        if rows.dtype != bool or rows.shape != shape:
            raise EngineError(f"present must be a bool array of shape {shape}, got {rows.dtype} {rows.shape}")
        varying = {entity for slot in world.slots for entity in slot.entities}
        for index, entity in enumerate(world.entities):
            if index not in varying and not rows[:, index].all():
                raise EngineError(f"'{entity.name}' is in no slot of the world, so it is present in every env")
        for slot in world.slots:
            if (rows[:, slot.entities].sum(axis=1) > 1).any():
                row = int(np.argmax(rows[:, slot.entities].sum(axis=1) > 1))
                both = [world.entities[e].name for e in slot.entities if rows[row, e]]
                raise EngineError(f"env {ids[row]}: '{slot.name}' can be one of {' and '.join(both)}, not several")
        return rows

    def write(self, ids: Array, rows: Array) -> None:
        """Take over rows (E, entities)."""
        self.entities[ids] = rows
        self._derive()

    def carry(self, old: "Presence") -> None:
        """Take over the rows of the entities that another World's presence has by name."""
        before, after = paired(old.world, self.world, "entities")
        self.entities[:, after] = old.entities[:, before]
        self._derive()

    def changed(self, ids: Array, rows: Array) -> Array:
        """The envs of `ids` whose rows differ from those in force."""
        return ids[(self.entities[ids] != rows).any(axis=1)]

    def blank(self, name: str, array: Array) -> None:
        """Give what is absent its values in a field of the state.

        They are the same on every engine: the pose of the world's own frame, no velocity, the initial joint position.
        """
        if name == "body_pose":
            array[~self.bodies] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
        elif name == "body_twist":
            array[~self.bodies] = 0.0
        elif name == "joint_pos":
            array[...] = np.where(self.joints, array, self._initial_joints)
        elif name in ("joint_vel", "joint_effort"):
            array[~self.joints] = 0.0


def blocks(present: Array) -> Iterator[tuple[Array, Array]]:
    """A mask (E, K) as blocks (rows, columns) of what is present, rows of one pattern together."""
    if present.all():
        yield np.arange(len(present)), np.arange(present.shape[1])
        return
    patterns, which = np.unique(present, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        if pattern.any():
            yield np.flatnonzero(which.reshape(-1) == number), np.flatnonzero(pattern)


Writer = Callable[[Array, Array, Array | None, Array | None], None]
"""A primitive that writes two kinds of values (E, K, ...) to things of envs, such as poses and twists of bodies."""


def write_present(
    write: Writer, present: Array, ids: Array, which: Array, first: Array | None, second: Array | None
) -> None:
    """Write values of what is there, and nothing of what is not; `present` (N, all) is the mask of bodies or joints."""
    there = present[ids[:, None], which]
    if there.all():
        write(ids, which, first, second)
        return
    for rows, columns in blocks(there):
        at = np.ix_(rows, columns)
        write(ids[rows], which[columns], *(None if values is None else values[at] for values in (first, second)))


def bodies_there(world: World, present: Array) -> Array:
    """(B,) bool: the bodies that are there where these entities (E,) are; one of no entity always is."""
    return np.append(present, True)[np.array(world.body_entity, dtype=int)]

"""Pairs of things that touch: which may meet, by which coefficients, and which of them a contact sensor counts."""

from collections.abc import Iterator, Sequence

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.model.parts import BodyKind, ContactSensor
from anysim.model.world import World


def could_meet(world: World, bodies: Array, others: Array | None = None) -> Array:
    """(K, L) bool: whether bodies (K,) and others (L,), -1 for the world, collide unless they are excluded.

    One body does not with itself, nor a link with its parent, nor what is fixed with what is fixed. Without `others`
    they are the bodies themselves.
    """
    others = bodies if others is None else others
    (still, parent), (still_too, parent_too) = _kin(world, bodies), _kin(world, others)
    kin = (parent[:, None] == others) | (bodies[:, None] == parent_too)
    return ~((bodies[:, None] == others) | (still[:, None] & still_too) | kin)


def _kin(world: World, bodies: Array) -> tuple[Array, Array]:
    """Which bodies (K,) stand still, and the parent (K,) of each; -2 where it is no link."""
    parts = [None if body == WORLD else world.bodies[body] for body in bodies.tolist()]
    still = np.array([part is None or part.kind is BodyKind.STATIC for part in parts], dtype=bool)
    return still, np.array([-2 if part is None or part.kind is not BodyKind.LINK else part.parent for part in parts])


def may_meet(world: World, bodies: Array, others: Array | None = None) -> Array:
    """(K, L) bool: `could_meet`, without excluded pairs, and without two entities of one slot: one of them is there."""
    others = bodies if others is None else others
    entity = np.append(np.array(world.body_entity, dtype=int), -1)
    slot = np.full(len(world.entities) + 1, -1)  # the last one for what belongs to no entity
    for number, one in enumerate(world.slots):
        slot[list(one.entities)] = number
    first, second = entity[bodies][:, None], entity[others]
    apart = (slot[first] == slot[second]) & (slot[second] >= 0) & (first != second)
    named = np.unique(np.array([*world.excluded_pairs], dtype=int))
    number = np.full(len(world.bodies) + 1, len(named))  # the world is the last one, by its index of -1
    number[named] = np.arange(len(named))
    excluded = np.zeros((len(named) + 1,) * 2, dtype=bool)
    for low, high in world.excluded_pairs:
        excluded[number[low], number[high]] = excluded[number[high], number[low]] = True
    return could_meet(world, bodies, others) & ~(apart | excluded[np.ix_(number[bodies], number[others])])


def pair_friction(friction: Array, priority: Array) -> Array:
    """(K, K) by the pair rule, of coefficients (K,): the larger one, or that of the surface of higher priority."""
    above = priority[:, None] - priority
    return np.where(above > 0, friction[:, None], np.where(above < 0, friction, np.maximum.outer(friction, friction)))


def pair_restitution(restitution: Array) -> Array:
    """(K, K) by the pair rule, of coefficients (K,): the larger one."""
    return np.maximum.outer(restitution, restitution)


def counted(sensor: ContactSensor, first: Array, second: Array) -> tuple[Array, Array]:
    """Which contacts (C,) a sensor counts as one on their first bodies (C,), and which as one on their second."""
    own = _among(first, sensor.bodies), _among(second, sensor.bodies)
    if sensor.against is None:
        return own
    return own[0] & _among(second, sensor.against), own[1] & _among(first, sensor.against)


def concerned(sensors: Sequence[ContactSensor], first: Array, second: Array) -> Iterator[tuple[int, Array, Array]]:
    """The places of sensors whose bodies are among these, with what `counted` says."""
    touched = {*first.tolist(), *second.tolist()}
    for place, sensor in enumerate(sensors):
        if not touched.isdisjoint(sensor.bodies):
            yield place, *counted(sensor, first, second)


def _among(bodies: Array, some: tuple[int, ...]) -> Array:
    """Which of the bodies (C,) are some of these: `np.isin`, which takes 30 us also where a sensor has one body."""
    if len(some) > 8:
        return np.isin(bodies, some)
    found = np.zeros(len(bodies), dtype=bool)
    for one in some:
        found |= bodies == one
    return found

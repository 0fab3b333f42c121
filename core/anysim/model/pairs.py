"""Pairs of things that touch: which may meet, by which coefficients, and which of them a contact sensor counts."""

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.model.parts import BodyKind, ContactSensor
from anysim.model.world import World


def could_meet(world: World, bodies: Array) -> Array:
    """(K, K) bool: whether these bodies (K,), -1 for the world, collide unless they are excluded.

    One body does not with itself, nor a link with its parent, nor what is fixed with what is fixed.
    """
    parts = [None if body == WORLD else world.bodies[body] for body in bodies.tolist()]
    still = np.array([part is None or part.kind is BodyKind.STATIC for part in parts], dtype=bool)
    parent = np.array([-2 if part is None or part.kind is not BodyKind.LINK else part.parent for part in parts])
    child = parent[:, None] == bodies
    return ~((bodies[:, None] == bodies) | (still[:, None] & still) | child | child.T)


def may_meet(world: World, bodies: Array) -> Array:
    """(K, K) bool: `could_meet`, without excluded pairs, and without two entities of one slot: one of them is there."""
    entity = np.append(np.array(world.body_entity, dtype=int), -1)[bodies]
    slot = np.full(len(world.entities) + 1, -1)  # the last one for what belongs to no entity
    for number, one in enumerate(world.slots):
        slot[list(one.entities)] = number
    apart = (slot[entity][:, None] == slot[entity]) & (slot[entity] >= 0) & (entity[:, None] != entity)
    excluded = np.zeros((len(world.bodies) + 1,) * 2, dtype=bool)
    for low, high in world.excluded_pairs:
        excluded[low, high] = excluded[high, low] = True  # the world is the last row, by its index of -1
    return could_meet(world, bodies) & ~(apart | excluded[np.ix_(bodies, bodies)])


def pair_friction(friction: Array, priority: Array) -> Array:
    """(K, K) by the pair rule, of coefficients (K,): the larger one, or that of the surface of higher priority."""
    above = priority[:, None] - priority
    return np.where(above > 0, friction[:, None], np.where(above < 0, friction, np.maximum.outer(friction, friction)))


def pair_restitution(restitution: Array) -> Array:
    """(K, K) by the pair rule, of coefficients (K,): the larger one."""
    return np.maximum.outer(restitution, restitution)


def counted(sensor: ContactSensor, first: Array, second: Array) -> tuple[Array, Array]:
    """Which contacts (C,) a sensor counts as one on their first bodies (C,), and which as one on their second."""
    own = np.isin(first, sensor.bodies), np.isin(second, sensor.bodies)
    if sensor.against is None:
        return own
    return own[0] & np.isin(second, sensor.against), own[1] & np.isin(first, sensor.against)

"""Contents of a hand: what its links press on from two sides."""

import numpy as np

from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import STAY
from anysim.task.scene import ObjectView
from anysim_skills.arm import Arm

FIRM = 0.5
"""[N] on a link, from which on it presses."""
AGAINST = -0.5
"""Cosine between the forces on two links below which they hold what is between them."""


class InFingers:
    """Whether the hand of `arm` holds something else than `thing`."""

    def __init__(self, arm: Arm, thing: ObjectView) -> None:
        world = arm.env.engine.world
        self._engine = arm.env.engine
        self._sensed = Capability.CONTACT_POINTS in self._engine.capabilities
        wrist = world.joints[arm.chain.joints[-1]].body
        self._hand = np.isin(np.arange(len(world.bodies) + 1), world.carried_by(wrist))
        """(B + 1,) bool; the last is the world, as the contacts' -1."""
        self._owner = np.array([*world.body_entity, -1])
        self._robot, self._asked = world.entity_numbers[arm.robot.name], np.array(thing.slot.entities)

    def judged(self, ids: Array, ended: Array, code: int) -> Array:
        """(n,) STAY; where it has ended (n,) bool, `code`, or WRONG_OBJECT where that is what is held."""
        said = np.where(ended, code, STAY)
        if ended.any():
            said[np.flatnonzero(ended)[self.others(ids[ended])]] = _WRONG
        return said

    def kept(self, ids: Array, held: Array, said: Array) -> Array:
        """(n,) `said` (n,) where the thing is held (n,) bool, else UNSTABLE_GRASP, or WRONG_OBJECT as of `judged`."""
        return np.where(held, said, self.judged(ids, ~held, _UNSTABLE))

    def others(self, ids: Array) -> Array:
        """(n,) bool: two links of the hand press against each other on another entity, and none touches the thing."""
        found = np.zeros(len(ids), dtype=bool)
        if not self._sensed:
            return found
        points = self._engine.contacts(ids)
        second = self._hand[points.body_b]
        mine = self._hand[points.body_a] ^ second
        link, other = np.where(second, points.body_b, points.body_a), np.where(second, points.body_a, points.body_b)
        owner, force = self._owner[other], np.where(second[:, None], points.force, -points.force)
        for row, env in enumerate(ids.tolist()):
            here = mine & (points.env == env)
            if not np.isin(owner[here], self._asked).any():
                entities = set(owner[here].tolist()) - {-1, self._robot}
                found[row] = any(_held(link[own], force[own]) for e in entities for own in [here & (owner == e)])
        return found


def _held(links: Array, forces: Array) -> bool:
    """Whether forces (c, 3) on links (c,) press two of them apart."""
    total = np.array([forces[links == link].sum(axis=0) for link in np.unique(links)])
    size = P.norm(total)
    firm = total[size > FIRM] / size[size > FIRM, None]
    return bool((firm @ firm.T < AGAINST).any())


_WRONG, _UNSTABLE = OUTCOMES.index(Outcome.WRONG_OBJECT), OUTCOMES.index(Outcome.UNSTABLE_GRASP)

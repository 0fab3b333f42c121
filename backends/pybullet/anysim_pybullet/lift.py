"""Gravity compensation of robots that motors move (`actuation: native`): torques that are given in every step."""

from typing import TYPE_CHECKING, Any

import numpy as np

from anysim.conventions import Array
from anysim_mechanics.gravity_compensation import GravityCompensation
from anysim_mechanics.trees import Tree

if TYPE_CHECKING:
    from anysim_pybullet.client import Env


class Lifter:
    """Applies the torques to some articulations of one env."""

    def __init__(self, env: "Env", index: int, lift: GravityCompensation, trees: list[Tree]) -> None:
        self._client, self._index, self._lift = env.id, index, lift
        self._trees = [(tree, env.root_ids[tree.number], env.tree_links[tree.number]) for tree in trees]

    def run(self, p: Any, steps: int, position: Array | None = None) -> bool:
        """Step, without anything else; False where the state was found not finite, and the env stood still then.

        `position` holds the joint positions (J,) that Bullet has now, where somebody knows them.
        """
        client = self._client
        if not self._trees:
            for _ in range(steps):
                p.stepSimulation(physicsClientId=client)
            return True
        held = self._held()
        while steps > 0:
            if self._lift.due(self._index):
                if not self._renew(p, position):
                    return False
                held = self._held()
            position, some = None, self._lift.spend(self._index, steps)
            for _ in range(some):
                for uid, links, forces in held:
                    p.setJointMotorControlArray(uid, links, p.TORQUE_CONTROL, forces=forces, physicsClientId=client)
                p.stepSimulation(physicsClientId=client)
            steps -= some
        return True

    def push(self, p: Any) -> bool:
        """Apply the torques of the next step; False where they are not finite."""
        if not self._trees:
            return True
        if self._lift.due(self._index) and not self._renew(p, None):
            return False
        self._lift.spend(self._index, 1)
        for uid, links, forces in self._held():
            p.setJointMotorControlArray(uid, links, p.TORQUE_CONTROL, forces=forces, physicsClientId=self._client)
        return True

    def _renew(self, p: Any, position: Array | None) -> bool:
        for tree, uid, links in self._trees:
            known = position
            if known is None:
                known = np.zeros(self._lift.torque.shape[1])
                known[tree.joints] = [s[0] for s in p.getJointStates(uid, links, physicsClientId=self._client)]
            if not self._lift.renew(self._index, tree, known):
                return False
        return True

    def _held(self) -> list[tuple[int, list[int], list[float]]]:
        torque = self._lift.torque[self._index]
        return [(uid, links, torque[tree.joints].tolist()) for tree, uid, links in self._trees]

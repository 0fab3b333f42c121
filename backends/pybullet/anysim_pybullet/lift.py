"""Gravity compensation of robots that motors move (`actuation: native`): Bullet cannot spare a body its gravity.

Where the law runs, it takes the weight away in each step. Here nothing else needs the robot's state, so the torques are
worked out in every tenth step of an env and held in between; the steps are counted, not the calls that make them.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from anysim.conventions import Array
from anysim_pybullet import kernels as K
from anysim_pybullet.tree import Tree

if TYPE_CHECKING:
    from anysim_pybullet.client import Env
    from anysim_pybullet.law import Laws

EVERY = 10
"""Steps for which torques are held."""


class Lift:
    """Torques that cancel the weight of compensated bodies, env by env."""

    def __init__(self, num_envs: int, joints: int) -> None:
        self.torque = np.zeros((num_envs, joints))
        self.age = np.zeros(num_envs, dtype=np.int64)
        """Steps for which the torques are held already, 0 where they must be worked out."""

    def forget(self, ids: Array | int) -> None:
        """The joints of these envs were written."""
        self.age[ids] = 0


class Lifter:
    """Applies the torques to some articulations of one env."""

    def __init__(self, env: "Env", index: int, laws: "Laws", trees: list[Tree]) -> None:
        self._client = env.id
        self._index, self._laws, self._lift = index, laws, laws.lift
        self._trees = [(tree, env.root_ids[tree.number], env.tree_links[tree.number]) for tree in trees]

    def run(self, p: Any, steps: int, position: Array | None = None) -> bool:
        """Step, without anything else; False where the state was found not finite, and the env stood still then.

        `position` holds the joint positions (J,) that Bullet has now, where somebody knows them.
        """
        client, ages = self._client, self._lift.age
        if not self._trees:
            for _ in range(steps):
                p.stepSimulation(physicsClientId=client)
            return True
        held = self._held()
        while steps > 0:
            age = int(ages[self._index])
            if age == 0:
                if not self._renew(p, position):
                    return False
                held = self._held()
            position, some = None, min(steps, EVERY - age)
            for _ in range(some):
                for uid, links, forces in held:
                    p.setJointMotorControlArray(uid, links, p.TORQUE_CONTROL, forces=forces, physicsClientId=client)
                p.stepSimulation(physicsClientId=client)
            ages[self._index] = (age + some) % EVERY
            steps -= some
        return True

    def push(self, p: Any) -> bool:
        """Apply the torques of the next step; False where they are not finite."""
        if not self._trees:
            return True
        ages = self._lift.age
        if ages[self._index] == 0 and not self._renew(p, None):
            return False
        ages[self._index] = (ages[self._index] + 1) % EVERY
        for uid, links, forces in self._held():
            p.setJointMotorControlArray(uid, links, p.TORQUE_CONTROL, forces=forces, physicsClientId=self._client)
        return True

    def _renew(self, p: Any, position: Array | None) -> bool:
        laws, index = self._laws, self._index
        for tree, uid, links in self._trees:
            if position is None:
                known = np.zeros(len(self._lift.torque[index]))
                known[tree.joints] = [s[0] for s in p.getJointStates(uid, links, physicsClientId=self._client)]
            else:
                known = position
            good = K.weight(
                tree.joint_ints,
                tree.joint_floats,
                laws.bodies[index],
                tree.bodies,
                laws.gravity[index],
                laws.roots[index, tree.bodies[0]],
                known,
                tree.joints,
                tree.first,
                self._lift.torque[index],
            )
            if not good:
                return False
        return True

    def _held(self) -> list[tuple[int, list[int], list[float]]]:
        torque = self._lift.torque[self._index]
        return [(uid, links, torque[tree.joints].tolist()) for tree, uid, links in self._trees]

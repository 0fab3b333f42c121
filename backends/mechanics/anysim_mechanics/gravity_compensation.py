"""Gravity compensation beside a library's own motors, where it cannot spare a body its gravity.

Where the drive law is computed, it takes the weight away in each step. Here nothing else needs the robot's state, so
the torques are worked out in every tenth step of an env and held in between; the steps are counted, not the calls that
make them.
"""

import numpy as np

from anysim.conventions import Array
from anysim_mechanics import articulation as K
from anysim_mechanics.computed_drives import DriveArrays
from anysim_mechanics.trees import Tree

EVERY = 10
"""Steps for which torques are held."""


class GravityCompensation:
    """Torques that cancel the weight of compensated bodies, env by env.

    Attributes:
        torque: (N, J) [N m, N].
        age: (N,) steps for which the torques are held already, 0 where they must be worked out.
    """

    def __init__(self, arrays: DriveArrays) -> None:
        self._arrays = arrays
        self.torque = np.zeros(arrays.drives.shape[:2])
        self.age = np.zeros(len(self.torque), dtype=np.int64)

    def forget(self, ids: Array | int) -> None:
        """The joints of these envs were written."""
        self.age[ids] = 0

    def due(self, env: int) -> bool:
        """Whether `renew` must be called for the env's trees before its next step."""
        return self.age[env] == 0

    def renew(self, env: int, tree: Tree, position: Array) -> bool:
        """Work out the torques of a tree at the env's joint positions (J,); False where they are not finite."""
        bodies, gravity, root = (part[env] for part in (self._arrays.bodies, self._arrays.gravity, self._arrays.roots))
        terms = tree.joint_ints, tree.joint_floats, bodies, tree.bodies, gravity, root[tree.bodies[0]], position
        return K.weight(*terms, tree.joints, tree.first, self.torque[env])

    def spend(self, env: int, steps: int) -> int:
        """How many of some steps the torques are good for; these are counted."""
        some = min(steps, EVERY - int(self.age[env]))
        self.age[env] = (self.age[env] + some) % EVERY
        return some

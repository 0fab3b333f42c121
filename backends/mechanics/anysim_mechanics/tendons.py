"""Forces of fixed tendons where a library's solver takes the damping of joints.

A tendon damps each of its joints by their own speed, which the solver takes at the end of the step, and by that of the
others, which is taken at the beginning: the solver knows of no damping between two joints.
"""

import numpy as np

from anysim.conventions import Array
from anysim.model.world import World


class Tendons:
    """The springs and dampers of a World's tendons.

    Attributes:
        any: whether there are any.
        own_damping: (J,) what they damp each joint by its own speed.
    """

    def __init__(self, world: World) -> None:
        pulling = [t for t in world.tendons if t.stiffness or t.damping]
        self.any = bool(pulling)
        self._shares = np.zeros((len(pulling), len(world.joints)))
        for row, tendon in zip(self._shares, pulling, strict=True):
            np.add.at(row, list(tendon.joints), tendon.coefficients)
        self._stiffness, self._damping = np.reshape([(t.stiffness, t.damping) for t in pulling], (-1, 2)).T
        self._short, self._long = np.reshape([t.rest for t in pulling], (-1, 2)).T
        self.own_damping: Array = self._damping @ self._shares**2

    def forces(self, joints: Array, position: Array, velocity: Array) -> Array:
        """Forces (n,) on these joints, of one articulation, at their positions and velocities (n,)."""
        shares = self._shares[:, joints]
        length = shares @ position
        tension = self._stiffness * (np.clip(length, self._short, self._long) - length)
        slowed = self._damping * (shares @ velocity)
        return (tension - slowed) @ shares + self.own_damping[joints] * velocity

"""PhysX' own drives, for `actuation: native`: stiffness and damping that the solver takes implicitly, both of them.

Gains, targets and limits are given once, not in each substep. Feed-forward moves the target, so that the effort limit
bounds it as well; a joint's own damping is part of its drive, with a target that leaves the law as it is.
"""

import numpy as np

from anysim.conventions import Array
from anysim.model.world import Actuation, World
from anysim_sapien.drives import Drives
from anysim_sapien.scene import UNBOUNDED, EnvScene


class NativeDrives(Drives):
    """Drives of all envs, and what PhysX has been told of them."""

    each_substep = False

    def __init__(self, world: World, num_envs: int) -> None:
        # position and velocity target, stiffness, damping, limit, force
        self._wanted = np.zeros((num_envs, len(world.joints), 6))
        self._known = np.full_like(self._wanted, np.nan)
        super().__init__(world, num_envs)

    def _update(self) -> None:
        """Make PhysX' terms from those of the law."""
        super()._update()
        self._kernels.native_orders(self._control, self._actuator, self._law, UNBOUNDED, self._wanted)

    def target(self, env: int, joint: int) -> tuple[float, float]:
        """The position and velocity targets that PhysX gets for a joint."""
        return float(self._wanted[env, joint, 0]), float(self._wanted[env, joint, 1])

    def forget(self, env: int) -> None:
        """The env's scene is new: PhysX has none of these numbers."""
        super().forget(env)
        self._known[env] = np.nan

    def given(self, env: int) -> Array:
        """What PhysX has been told of an env's drives (J, 6)."""
        return self._known[env].copy()

    def adopt(self, env: int, told: Array) -> None:
        """The env's scene is another one, which was told this."""
        self._known[env] = told

    def begin(self, env: int, scene: EnvScene) -> None:
        """Tell PhysX what changed."""
        kernels, there = self._kernels, scene.layout.joint_there
        count = kernels.changes(self._wanted, self._known, env, there, self._news)
        if not count:
            return
        joints, rows, forced = scene.joints, self._wanted[env].tolist(), False
        for j, what in self._news[:count].tolist():
            position, velocity, stiffness, damping, limit, _ = rows[j]
            if what & kernels.GAINS:
                joints[j].set_drive_properties(stiffness, damping, limit, "force")
            if what & kernels.TARGET:
                joints[j].set_drive_target(position)
            if what & kernels.SPEED:
                joints[j].set_drive_velocity_target(velocity)
            forced |= bool(what & kernels.FORCE)
        if forced:
            for tree in scene.trees:
                tree.handle.set_qf(self._wanted[env, tree.joints, 5].astype(np.float32))


def drives_of(world: World, num_envs: int) -> Drives:
    """The drives that the World's actuation asks for."""
    return (NativeDrives if world.physics.actuation is Actuation.NATIVE else Drives)(world, num_envs)

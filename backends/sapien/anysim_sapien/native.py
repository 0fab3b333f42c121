"""PhysX' own drives, for `actuation: native`: stiffness and damping that the solver takes implicitly, both of them.

Gains, targets and limits are given once, not in each substep. Feed-forward moves the target, so that the effort limit
bounds it as well; a joint's own damping is part of its drive, with a target that leaves the law as it is.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.model.world import Actuation, World
from anysim_sapien.drives import Drives
from anysim_sapien.scene import UNBOUNDED, EnvScene, positions_of, velocities_of

_GAINS = slice(2, 5)  # in `wanted`: position and velocity target, stiffness, damping, limit, force


class NativeDrives(Drives):
    """Drives of all envs, and what PhysX has been told of them."""

    each_substep = False

    def __init__(self, world: World, num_envs: int) -> None:
        super().__init__(world, num_envs)
        self._wanted = np.zeros((num_envs, len(world.joints), 6))
        self._known = np.full_like(self._wanted, np.nan)

    def _update(self) -> None:
        """Make PhysX' terms from those of the law."""
        super()._update()
        stiff = self._stiffness > 0
        whole = self._damping + self.passive
        shift = np.divide(self._feed, self._stiffness, out=np.zeros_like(whole), where=stiff)
        position, velocity = np.zeros_like(whole), np.zeros_like(whole)
        if self._control is not None:
            position[:, self._joint] = self._control.position
            velocity[:, self._joint] = self._control.velocity
        braked = ~stiff & (self._damping > 0)
        push = self._damping * velocity + np.where(braked, self._feed, 0.0)
        wanted = self._wanted
        wanted[..., 0] = np.where(stiff, position + shift, 0.0)
        wanted[..., 1] = np.divide(push, whole, out=np.zeros_like(whole), where=whole > 0)
        wanted[..., 2], wanted[..., 3] = self._stiffness, whole
        # a drive in effort mode exerts a force, and its joint's damping has no limit
        wanted[..., 4] = np.where(stiff | braked, np.minimum(self._bound, UNBOUNDED), UNBOUNDED)
        wanted[..., 5] = np.where(stiff | braked, 0.0, np.clip(self._feed, -self._bound, self._bound))

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
        wanted, told = self._wanted[env], self._known[env]
        changed = (wanted != told) & scene.layout.joint_there[:, None]
        if not changed.any():
            return
        joints, rows = scene.joints, wanted.tolist()
        for j in np.flatnonzero(changed[:, _GAINS].any(axis=1)).tolist():
            joints[j].set_drive_properties(*rows[j][_GAINS], "force")
        for j in np.flatnonzero(changed[:, 0]).tolist():
            joints[j].set_drive_target(rows[j][0])
        for j in np.flatnonzero(changed[:, 1]).tolist():
            joints[j].set_drive_velocity_target(rows[j][1])
        if changed[:, 5].any():
            for tree in scene.trees:
                tree.handle.set_qf(wanted[tree.joints, 5].astype(np.float32))
        told[...] = wanted

    def note(self, envs: Any, scenes: Sequence[EnvScene]) -> None:
        """What the drives exerted, by their law at the end of the substep."""
        law = self._push[envs] + self._feed[envs] - self._stiffness[envs] * positions_of(scenes)
        law -= self._damping[envs] * velocities_of(scenes)
        self.effort[envs] = np.clip(law, -self._bound[envs], self._bound[envs])


def drives_of(world: World, num_envs: int) -> Drives:
    """The drives that the World's actuation asks for."""
    return (NativeDrives if world.physics.actuation is Actuation.NATIVE else Drives)(world, num_envs)

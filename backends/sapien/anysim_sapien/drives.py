"""The drives, as PhysX is given them; see `anysim_mechanics.damped_drives` for the law.

It holds for the PGS solver: TGS applies forces at once and damping bit by bit, and damped joints get much too slow.
"""

import numpy as np

from anysim.model.world import Actuation, World
from anysim_mechanics import damped_drives as D
from anysim_sapien.scene import UNBOUNDED, EnvScene


class LawDrives(D.DampedDrives):
    """The law as a force in each substep, its damping as PhysX' own drives: `told` is theirs (N, 3, J)."""

    def __init__(self, world: World, num_envs: int) -> None:
        super().__init__(world, num_envs, np.full((num_envs, 3, len(world.joints)), np.nan))

    def begin(self, env: int, scene: EnvScene) -> None:
        """Before the first substep of a call: nothing, the law is given anew in each."""

    def substep(self, env: int, scene: EnvScene) -> None:
        """Give PhysX the law's terms at the present state."""
        count, news = 0, self.news
        for handle, _, joints, force in scene.trees:
            position, velocity = handle.get_qpos(), handle.get_qvel()
            count = D.substep(
                self.law, env, joints, position, velocity, self.kind, UNBOUNDED, self.told, force, news, count
            )
            if self.tendons.any:
                force += self.tendons.forces(joints, position, velocity)
            handle.set_qf(force)
        if count:
            self._tell(env, scene, count)

    def _tell(self, env: int, scene: EnvScene, count: int) -> None:
        damping, limit, target = self.told[env].tolist()
        for j, what in self.news[:count].tolist():
            if what & D.GAINS:
                scene.joints[j].set_drive_properties(0.0, damping[j], limit[j], "force")
            if what & D.SPEED:
                scene.joints[j].set_drive_velocity_target(target[j])


class NativeDrives(D.DampedDrives):
    """PhysX' own drives, for `actuation: native`: stiffness and damping that the solver takes implicitly, both of them.

    Gains, targets and limits are given once, not in each substep. Feed-forward moves the target, so that the effort
    limit bounds it as well; a joint's own damping is part of its drive, with a target that leaves the law as it is.
    `told` is what PhysX has of `wanted` (N, J, 6): targets, stiffness, damping, limit, and force.
    """

    def __init__(self, world: World, num_envs: int) -> None:
        self.wanted = np.zeros((num_envs, len(world.joints), 6))
        self._sprung = any(joint.stiffness for joint in world.joints) or bool(world.tendons)
        super().__init__(world, num_envs, np.full_like(self.wanted, np.nan))

    def _update(self) -> None:
        """Make PhysX' terms from those of the law."""
        super()._update()
        none = np.zeros((len(self.passive), 0))
        position, velocity, *_ = (none, none) if self.control is None else self.control
        D.native_terms(position, velocity, self.gains.joint, self.law, UNBOUNDED, self.wanted)

    def begin(self, env: int, scene: EnvScene) -> None:
        """Tell PhysX what changed."""
        count = D.changes(self.wanted, self.told, env, scene.layout.joint_there, self.news)
        if not count:
            return
        joints, rows, forced = scene.joints, self.wanted[env].tolist(), False
        for j, what in self.news[:count].tolist():
            position, velocity, stiffness, damping, limit, _ = rows[j]
            if what & D.GAINS:
                joints[j].set_drive_properties(stiffness, damping, limit, "force")
            if what & D.TARGET:
                joints[j].set_drive_target(position)
            if what & D.SPEED:
                joints[j].set_drive_velocity_target(velocity)
            forced |= bool(what & D.FORCE)
        if forced:
            for tree in scene.trees:
                tree.handle.set_qf(self.wanted[env, tree.joints, 5].astype(np.float32))

    def substep(self, env: int, scene: EnvScene) -> None:
        """Before a substep: the force of springs; PhysX has all of the law."""
        for tree in scene.trees if self._sprung else ():
            (stiffness, rest), position = self.springs[:, tree.joints], tree.handle.get_qpos()
            fed = self.wanted[env, tree.joints, 5] + stiffness * (rest - position)
            fed += self.tendons.forces(tree.joints, position, tree.handle.get_qvel())
            tree.handle.set_qf(fed.astype(np.float32))


Drives = LawDrives | NativeDrives


def drives_of(world: World, num_envs: int) -> Drives:
    """The drives that the World's actuation asks for."""
    return (NativeDrives if world.physics.actuation is Actuation.NATIVE else LawDrives)(world, num_envs)

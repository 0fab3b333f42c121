"""Momentum of each env over its last substep, as read from PhysX; see `anysim_mechanics.momentum_balance`."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array, xyzw_from_wxyz
from anysim_mechanics.momentum_balance import Balance, Circumstances, MomentumBalance, Substep
from anysim_sapien.recipe import Recipes
from anysim_sapien.scene import EnvScene


class _SubstepNotes(NamedTuple):
    """What a substep did to an env: as read, since most steps are never asked about."""

    scene: EnvScene
    before: bytes
    links_before: list[Array]
    after: bytes
    given: Circumstances

    def substep(self) -> Substep:
        """The same as arrays."""
        scene, left = self.scene, self.scene.left()
        before, after = (np.frombuffer(packed, dtype=np.float32) for packed in (self.before, self.after))
        joint_force = np.zeros_like(scene.com)
        for order, rows in zip(scene.link_order(), left.forces, strict=True):
            joint_force[order] = rows[:, :3]
        velocities = [packed.take(scene.packing.velocity[:, :3]).astype(float) for packed in (before, after)]
        if self.links_before:
            for velocity, links in zip(velocities, (self.links_before, left.velocities), strict=True):
                velocity[scene.layout.links] = links
        turn = before.take(scene.packing.pose[:, 3:]).astype(float)
        return Substep(velocities[0], velocities[1], turn, joint_force)


class Momentum:
    """The balances of the last substep, per env."""

    def __init__(self, recipes: Recipes, num_envs: int) -> None:
        turns = [xyzw_from_wxyz(np.asarray(in_child.q, dtype=float)) for _, in_child in recipes.frames]
        self._rule = MomentumBalance(recipes.world, np.array(turns).reshape(-1, 4))
        self.noted: list[_SubstepNotes | None] = [None] * num_envs
        """What the last substep of each env did; None where there was none."""
        self._balance: list[Balance | None] = [None] * num_envs

    def forget(self, env: int) -> None:
        """The env's scene is new: nothing has touched."""
        self.noted[env] = self._balance[env] = None

    def adopt(self, env: int, other: "Momentum") -> None:
        """The env's scene is the one of `other`'s first env."""
        self.noted[env], self._balance[env] = other.noted[0], None

    def before(self, scene: EnvScene) -> None:
        """Right before the last substep: note velocities and orientations."""
        self._before = scene.pack(), scene.link_velocities()

    def after(self, env: int, scene: EnvScene, pushes: Array | None) -> None:
        """After the last substep, with `pushes` (K, 7): bodies and the wrenches that were on them."""
        self._balance[env] = None
        given = Circumstances(scene.gravity, scene.mass, scene.rubbing, scene.slowing, pushes)
        self.noted[env] = _SubstepNotes(scene, *self._before, scene.packed(), given)

    def balance(self, env: int) -> Balance:
        """Net contact forces of the env's last substep; all in doubt where there was none."""
        found, noted = self._balance[env], self.noted[env]
        if found is None:
            found = self._rule.unknown() if noted is None else self._rule.solve(noted.substep(), noted.given)
            self._balance[env] = found
        return found

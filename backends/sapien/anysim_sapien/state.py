"""Reads of the neutral state from the scenes of all envs, and what is held where a scene was rebuilt or written."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from anysim.conventions import Array
from anysim.engine.state import FIELDS
from anysim.model.world import BodyKind, World
from anysim_sapien.contacts import sensor_forces
from anysim_sapien.drives import Drives
from anysim_sapien.momentum import Momentum
from anysim_sapien.motion import twists_of
from anysim_sapien.scene import EnvScene, poses_of, positions_of, velocities_of
from anysim_sapien.velocities import LinkVelocities


class StateReader:
    """What the last substep left behind, per env.

    Twists of links are made from joint velocities and the links' poses: PhysX' own belong to the poses before the step.

    Contact forces belong to the last substep: writing a state does not change them, a reset makes them zero. A scene
    that was built anew has none, so theirs are kept here. Poses and twists are PhysX' own, but after live editing:
    putting joint positions back moves a link by a rounding error, so those that were read before are kept as well.
    """

    def __init__(self, world: World, scenes: list[EnvScene], drives: Drives, momentum: Momentum) -> None:
        n, bodies = len(scenes), len(world.bodies)
        self._world, self._scenes, self._drives = world, scenes, drives
        self._momentum = momentum
        self._free = [i for i, b in enumerate(world.bodies) if b.kind is BodyKind.FREE]
        self._velocities = LinkVelocities(world)
        self._held_contact = np.ones(n, dtype=bool)
        self._contact = np.zeros((n, len(world.contact_sensors), 3))
        self._held_motion = np.zeros(n, dtype=bool)
        self._motion = np.zeros((n, bodies, 13))
        self.fields: Mapping[str, Callable[[], Array]] = {name: getattr(self, name) for name in FIELDS}
        """Reads a fresh array of one of the neutral fields."""

    # ------------------------------------------------------------------ what is held

    def stepped(self, env: int) -> None:
        """Everything of this env is new."""
        self._held_contact[env] = self._held_motion[env] = False

    def written(self, env: int) -> None:
        """The env's state was written; its contact forces stay those of the last substep."""
        self._held_motion[env] = False

    def keep_contact(self, env: int) -> None:
        """The env's scene is about to be built anew: note its contact forces."""
        if not self._held_contact[env]:
            self.hold_contact(env, self._touch(env))

    def hold_contact(self, env: int, force: Array | float) -> None:
        """Make these the contact forces (S, 3) of the last substep."""
        self._held_contact[env] = True
        self._contact[env] = force

    def hold_motion(self, env: int, bodies: Array, pose: Array, twist: Array) -> None:
        """Make these the poses (K, 7) and twists (K, 6) of bodies, until the env moves on."""
        self._motion[env, :, :7], self._motion[env, :, 7:] = self._poses(env), self._twists(env)
        self._motion[env, bodies, :7], self._motion[env, bodies, 7:] = pose, twist
        self._held_motion[env] = True

    def rows(self, ids: Array) -> dict[str, Array]:
        """What a snapshot holds of this: contact forces, and motions where they are held."""
        motion = np.where(self._held_motion[ids, None, None], self._motion[ids], 0.0)
        return {"contact": self.contact_force()[ids], "held": self._held_motion[ids], "held_motion": motion}

    def put_rows(self, env: int, data: Mapping[str, Array], row: int) -> None:
        """Write a row that `rows` made."""
        self.hold_contact(env, data["contact"][row])
        self._held_motion[env], self._motion[env] = data["held"][row], data["held_motion"][row]

    # ------------------------------------------------------------------ fields

    def _poses(self, env: int) -> Array:
        return self._scenes[env].poses()

    def body_pose(self) -> Array:
        poses = poses_of(self._scenes)
        if self._held_motion.any():
            poses[self._held_motion] = self._motion[self._held_motion, :, :7]
        return poses

    def _twists(self, env: int) -> Array:
        return self._twists_of(self._scenes[env : env + 1])[0]

    def _twists_of(self, scenes: Sequence[EnvScene]) -> Array:
        """(N, B, 6), all envs in one go."""
        poses, twists = poses_of(scenes), np.zeros((len(scenes), len(self._world.bodies), 6))
        if self._free:
            twists[:, self._free] = twists_of(scenes, self._free, poses[:, self._free, 3:])
        if scenes[0].trees:
            self._velocities.fill(twists, poses, velocities_of(scenes))
        return twists

    def body_twist(self) -> Array:
        twists = self._twists_of(self._scenes)
        if self._held_motion.any():
            twists[self._held_motion] = self._motion[self._held_motion, :, 7:]
        return twists

    def joint_pos(self) -> Array:
        return positions_of(self._scenes)

    def joint_vel(self) -> Array:
        return velocities_of(self._scenes)

    def joint_effort(self) -> Array:
        return self._drives.effort.copy()

    def contact_force(self) -> Array:
        force = self._contact.copy()
        for env in np.flatnonzero(~self._held_contact):
            force[env] = self._touch(int(env))
        return force

    def _touch(self, env: int) -> Array:
        return sensor_forces(self._world, self._scenes[env], self._momentum, env)

    def fault(self) -> Array:
        return np.array([not self._finite(scene) for scene in self._scenes], dtype=bool)

    def _finite(self, scene: EnvScene) -> bool:
        packed = np.frombuffer(scene.system.pack(), dtype=np.float32)
        return bool(np.isfinite(packed).all() and np.isfinite(scene.poses()).all())

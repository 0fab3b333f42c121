"""Reads of the neutral state from the scenes of all envs, and what is held where a scene was rebuilt or written."""

from collections.abc import Callable, Mapping

import numpy as np

from anysim.conventions import Array
from anysim.engine.state import FIELDS
from anysim.model.world import World
from anysim_sapien.contacts import sensor_forces
from anysim_sapien.drives import Drives
from anysim_sapien.momentum import Momentum
from anysim_sapien.packing import Batch
from anysim_sapien.scene import EnvScene
from anysim_sapien.velocities import Twists


class StateReader:
    """What the last substep left behind, per env.

    Contact forces belong to the last substep: writing a state does not change them, a reset makes them zero. A scene
    that was built anew has none, so theirs are kept here. Poses and twists are PhysX' own, but after live editing:
    putting joint positions back moves a link by a rounding error, so those that were read before are kept as well.
    """

    def __init__(self, world: World, scenes: list[EnvScene], drives: Drives, momentum: Momentum) -> None:
        n, bodies = len(scenes), len(world.bodies)
        self._world, self._scenes, self._drives = world, scenes, drives
        self._momentum = momentum
        self._twists = Twists(world)
        self._blobs: list[bytes] = []
        self._packed, self._batch = np.zeros(0), Batch([scene.packing for scene in scenes])
        self._coms: list[Array] = []
        self._com = np.zeros((n, bodies, 3))
        self._held_contact = set(range(n))
        self._contact = np.zeros((n, len(world.contact_sensors), 3))
        self._held_motion: set[int] = set()
        self._motion = np.zeros((n, bodies, 13))
        self.fields: Mapping[str, Callable[[], Array]] = {name: getattr(self, name) for name in FIELDS}
        """Reads a fresh array of one of the neutral fields."""

    # ------------------------------------------------------------------ what is held

    def stepped(self, env: int) -> None:
        """Everything of this env is new."""
        self._held_contact.discard(env)
        self._held_motion.discard(env)

    def written(self, env: int) -> None:
        """The env's state was written; its contact forces stay those of the last substep."""
        self._held_motion.discard(env)

    def keep_contact(self, env: int) -> None:
        """The env's scene is about to be built anew: note its contact forces."""
        if env not in self._held_contact:
            self.hold_contact(env, self._touch(env))

    def hold_contact(self, env: int, force: Array | float) -> None:
        """Make these the contact forces (S, 3) of the last substep."""
        self._held_contact.add(env)
        self._contact[env] = force

    def hold_motion(self, env: int, bodies: Array, pose: Array, twist: Array) -> None:
        """Make these the poses (K, 7) and twists (K, 6) of bodies, until the env moves on."""
        self._motion[env, :, :7], self._motion[env, :, 7:] = self._poses()[env], self._all_twists()[env]
        self._motion[env, bodies, :7], self._motion[env, bodies, 7:] = pose, twist
        self._held_motion.add(env)

    def rows(self, ids: Array) -> dict[str, Array]:
        """What a snapshot holds of this: contact forces, and motions where they are held."""
        held = np.array([env in self._held_motion for env in ids.tolist()], dtype=bool)
        motion = np.where(held[:, None, None], self._motion[ids], 0.0)
        return {"contact": self.contact_force()[ids], "held": held, "held_motion": motion}

    def put_rows(self, env: int, data: Mapping[str, Array], row: int) -> None:
        """Write a row that `rows` made."""
        self.hold_contact(env, data["contact"][row])
        self._motion[env] = data["held_motion"][row]
        (self._held_motion.add if data["held"][row] else self._held_motion.discard)(env)

    # ------------------------------------------------------------------ fields

    def _read(self) -> tuple[Array, Batch]:
        """What all scenes say now, one after the other, and where it is."""
        blobs, packings = [scene.packed() for scene in self._scenes], [scene.packing for scene in self._scenes]
        if packings != self._batch.packings:
            self._batch, self._blobs = Batch(packings), []  # the same bytes may be of other bodies
        if blobs != self._blobs:
            self._packed = np.frombuffer(b"".join(blobs), dtype=np.float32).astype(float)
            assert self._packed.size == self._batch.start[-1], "a scene has other parts than its recipe says"
            self._blobs = blobs
        return self._packed, self._batch

    def _poses(self) -> Array:
        packed, batch = self._read()
        return packed.take(batch.pose)

    def _all_twists(self) -> Array:
        coms = [scene.com for scene in self._scenes]
        if len(coms) != len(self._coms) or any(a is not b for a, b in zip(coms, self._coms, strict=True)):
            self._coms, self._com = coms, np.array(coms)
        return self._twists.of(*self._read(), self._com)

    def body_pose(self) -> Array:
        poses = self._poses()
        if self._held_motion:
            held = sorted(self._held_motion)
            poses[held] = self._motion[held, :, :7]
        return poses

    def body_twist(self) -> Array:
        twists = self._all_twists()
        if self._held_motion:
            held = sorted(self._held_motion)
            twists[held] = self._motion[held, :, 7:]
        return twists

    def joint_pos(self) -> Array:
        packed, batch = self._read()
        return packed.take(batch.joint_pos)

    def joint_vel(self) -> Array:
        packed, batch = self._read()
        return packed.take(batch.joint_vel)

    def joint_effort(self) -> Array:
        return self._drives.effort().copy()

    def contact_force(self) -> Array:
        force = self._contact.copy()
        for env in range(len(force)):
            if env not in self._held_contact:
                force[env] = self._touch(env)
        return force

    def _touch(self, env: int) -> Array:
        return sensor_forces(self._world, self._scenes[env], self._momentum, env)

    def fault(self) -> Array:
        packed, batch = self._read()
        finite = np.isfinite(packed)
        if finite.all():
            return np.zeros(len(self._scenes), dtype=bool)
        return ~np.logical_and.reduceat(finite, batch.start[:-1])

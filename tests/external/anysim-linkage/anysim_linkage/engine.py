"""The engine `linkage`: trees of joints on fixed bases, with drives."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capabilities, Capability, approximately
from anysim.engine.control import POSITION, VELOCITY, Control
from anysim.engine.state import Availability, SnapshotLevel
from anysim.model.world import World
from anysim_linkage import __version__
from anysim_linkage.motion import Drives, advance, body_poses, body_twists, stopped


class LinkageEngine(SimEngine):
    """Mechanisms on fixed bases; nothing touches anything. Each env is computed by itself."""

    name: ClassVar[str] = "linkage"
    capabilities: ClassVar[Capabilities] = Capabilities.of(
        Capability.ARTICULATIONS,
        Capability.ARMATURE,
        Capability.EFFORT_LIMITS,
        Capability.GRAVITY_COMPENSATION,
        Capability.CONTROL_POSITION,
        Capability.CONTROL_VELOCITY,
        Capability.CONTROL_EFFORT,
        Capability.SNAPSHOT_STATE,
        Capability.SNAPSHOT_TRAJECTORY,
        Capability.DYNAMICS,
        approximate={
            Capability.JOINT_LIMITS: approximately(
                "a stop at the end of a step: a drive whose dt kd is above its inertia swings on it "
                "(kd 300 on 0.115 kg at 2 ms: by {chatter:.0%} of 20 N)",
                chatter=0.85,
            )
        },
    )

    @classmethod
    def availability(cls) -> Availability:
        """Numpy is all it needs."""
        return Availability(True, __version__)

    # ------------------------------------------------------------------ lifecycle

    def _build(self, world: World, num_envs: int) -> None:
        shape = (num_envs, len(world.joints))
        self._q, self._v, self._exerted = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        self._roots = np.zeros((num_envs, len(world.bodies), 7))
        self._damping = np.array([joint.damping for joint in world.joints])
        self._driven = np.array([actuator.joint for actuator in world.actuators], dtype=int)
        self._gains = np.array([[a.kp, a.kd, a.effort_limit] for a in world.actuators]).reshape(-1, 3)
        self._told: Control | None = None

    def _free(self) -> None:
        del self._q, self._v, self._exerted, self._roots, self._told

    def _reset(self, ids: Array) -> None:
        self._q[ids] = [joint.initial for joint in self.world.joints]
        self._v[ids] = self._exerted[ids] = 0.0
        self._roots[ids] = self.world.initial_body_pose

    # ------------------------------------------------------------------ stepping

    def _step(self, n_steps: int, ids: Array | None) -> None:
        for env in (self._all if ids is None else ids).tolist():
            drives, world = self._drives(env), self.world
            for _ in range(n_steps):
                q, v, exerted = advance(world, self._roots[env], self._q[env], self._v[env], self._damping, drives)
                self._q[env], self._v[env] = stopped(world, q, v)
                self._exerted[env] = exerted

    def _drives(self, env: int) -> Drives:
        """The law of each drive of an env by its mode: a velocity drive has no stiffness, an effort drive no gains."""
        kp, kd, limit = self._gains.T
        if self._told is None:
            none = np.zeros(len(kp))
            return Drives(self._driven, none, none, limit, none, none, none)
        mode, target = self._told.mode[env], self._told
        kp = np.where(mode == POSITION, kp, 0.0)
        kd = np.where((mode == POSITION) | (mode == VELOCITY), kd, 0.0)
        return Drives(self._driven, kp, kd, limit, target.position[env], target.velocity[env], target.effort[env])

    def _apply_control(self, control: Control) -> None:
        self._told = Control(*(part.copy() for part in control))

    # ------------------------------------------------------------------ reading and writing

    def _read(self, name: str) -> Array:
        world, envs = self.world, range(self.num_envs)
        if name == "body_pose":
            return np.array([body_poses(world, self._roots[env], self._q[env]) for env in envs])
        if name == "body_twist":
            return np.array([body_twists(world, self._roots[env], self._q[env], self._v[env]) for env in envs])
        if name == "fault":
            return np.asarray(~(np.isfinite(self._q) & np.isfinite(self._v)).all(axis=1))
        if name == "contact_force":
            return np.zeros((self.num_envs, 0, 3))  # a world with contact sensors was refused
        return {"joint_pos": self._q, "joint_vel": self._v, "joint_effort": self._exerted}[name].copy()

    def _write_joints(self, ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
        if position is not None:
            self._q[np.ix_(ids, joints)] = position
        if velocity is not None:
            self._v[np.ix_(ids, joints)] = velocity

    def _write_bodies(self, ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        if pose is not None:
            self._roots[np.ix_(ids, bodies)] = pose

    # ------------------------------------------------------------------ snapshots and live editing

    def _snapshot(self, ids: Array, level: SnapshotLevel) -> dict[str, Array]:
        return {"q": self._q[ids], "v": self._v[ids], "exerted": self._exerted[ids], "roots": self._roots[ids]}

    def _restore(self, ids: Array, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        self._q[ids], self._v[ids], self._exerted[ids] = data["q"], data["v"], data["exerted"]
        self._roots[ids] = data["roots"]

    def _carry_rows(self) -> dict[str, Array]:
        """What a rebuilt world cannot know: the efforts of the last substep, by the names of the joints."""
        return {joint.name: self._exerted[:, i].copy() for i, joint in enumerate(self.world.joints)}

    def _take_rows(self, carried: dict[str, Array], old: World) -> None:
        for i, joint in enumerate(self.world.joints):
            self._exerted[:, i] = carried.get(joint.name, 0.0)

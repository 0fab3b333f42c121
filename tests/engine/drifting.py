"""The smallest engine with one world per env: bodies that keep their velocities, an object of a library per env."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from anysim.conventions import Array
from anysim.engine.capability import Capabilities, Capability
from anysim.engine.control import Control
from anysim.engine.parameters import ParameterTable
from anysim.engine.state import Availability, SnapshotLevel
from anysim.math import pose as P
from anysim.model.world import World
from anysim_mechanics.one_world.base import EnvWorlds, OneWorldPerEnv
from anysim_mechanics.one_world.last_substep import LastSubstep


class Drift:
    """The library: a world in which bodies keep their velocities."""

    def __init__(self, poses: Array) -> None:
        self.poses, self.twists = poses.copy(), np.zeros((len(poses), 6))

    def step(self, dt: float) -> None:
        """Advance by dt [s]."""
        moving = np.any(self.twists != 0.0, axis=1, keepdims=True)  # a body at rest keeps its bits
        rate = P.norm(self.twists[:, 3:])
        axis = self.twists[:, 3:] / np.where(rate == 0.0, 1.0, rate)[:, None]
        turned = P.normalize(P.multiply(P.from_axis_angle(axis, rate * dt), self.poses[:, 3:]))
        moved = np.concatenate([self.poses[:, :3] + dt * self.twists[:, :3], turned], axis=1)
        self.poses = np.where(moving, moved, self.poses)


class DriftingEnvs(EnvWorlds):
    """The worlds of all envs."""

    def __init__(self, world: World, num_envs: int) -> None:
        self.world, self.lost = world, np.zeros(num_envs, dtype=bool)
        self.last = LastSubstep(world, num_envs, self._exerted, self._touched)
        self.parameters = ParameterTable(world, num_envs)
        self.drifts = [Drift(world.initial_body_pose) for _ in range(num_envs)]

    def close(self) -> None:
        self.drifts.clear()

    def _exerted(self, env: int) -> None:
        """There is no drive."""

    def _touched(self, env: int) -> Array:
        return np.zeros((0, 3))  # a world with contact sensors was refused

    def reset(self, env: int) -> None:
        self.drifts[env] = Drift(self.world.initial_body_pose)

    def step(self, env: int, n_steps: int) -> None:
        for _ in range(n_steps):
            self.drifts[env].step(self.world.physics.dt)

    def read(self, name: str) -> Array:
        if name in ("joint_pos", "joint_vel"):
            return np.zeros((len(self.drifts), 0))
        poses, twists = (np.array([getattr(drift, kind) for drift in self.drifts]) for kind in ("poses", "twists"))
        if name == "fault":
            return np.asarray(~np.isfinite(np.concatenate([poses, twists], axis=-1)).all(axis=(1, 2)))
        return poses if name == "body_pose" else twists

    def write_joints(self, env: int, joints: Array, position: Array | None, velocity: Array | None) -> None:
        """There is none."""

    def write_bodies(self, env: int, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        if pose is not None:
            self.drifts[env].poses[bodies] = pose
        if twist is not None:
            self.drifts[env].twists[bodies] = twist

    def apply_control(self, control: Control) -> None:
        """There is nothing to drive."""

    def rows(self, env: int, level: SnapshotLevel) -> Mapping[str, ArrayLike]:
        return {"pose": self.drifts[env].poses, "twist": self.drifts[env].twists}

    def put_rows(self, env: int, rows: Mapping[str, Array], level: SnapshotLevel) -> None:
        self.drifts[env].poses, self.drifts[env].twists = rows["pose"].copy(), rows["twist"].copy()


class DriftingEngine(OneWorldPerEnv):
    """An engine of them."""

    name: ClassVar[str] = "drifting"
    capabilities: ClassVar[Capabilities] = Capabilities.of(
        Capability.RIGID_BODIES, Capability.SNAPSHOT_STATE, Capability.SNAPSHOT_TRAJECTORY
    )

    @classmethod
    def availability(cls) -> Availability:
        """It needs nothing but numpy."""
        return Availability(True, "1.0")

    def _make(self, world: World, present: Array) -> DriftingEnvs:
        return DriftingEnvs(world, len(present))

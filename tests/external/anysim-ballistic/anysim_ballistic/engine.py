"""The engine `ballistic`: free rigid bodies under gravity and external wrenches."""

from collections.abc import Callable, Mapping
from typing import ClassVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capabilities, Capability
from anysim.engine.control import Control
from anysim.engine.state import Availability, SnapshotLevel
from anysim.model.world import BodyKind, World
from anysim_ballistic import __version__
from anysim_ballistic.motion import Constants, advance
from anysim_ballistic.parameters import Parameters


class BallisticOptions(BaseModel):
    """Options of `ballistic`, as YAML writes them under `engine.options`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    rotation_steps: int = Field(default=1, ge=1, description="parts of a physics step, for the rotation; more is finer")


class BallisticEngine(SimEngine):
    """Free rigid bodies; nothing touches anything. Trajectories do not depend on the number of envs or their order."""

    name: ClassVar[str] = "ballistic"
    capabilities: ClassVar[Capabilities] = Capabilities.of(
        Capability.RIGID_BODIES,
        Capability.GRAVITY_COMPENSATION,
        Capability.WRENCHES,
        Capability.SNAPSHOT_STATE,
        Capability.SNAPSHOT_TRAJECTORY,
        Capability.PARAMETERS_PER_ENV,
        Capability.DYNAMICS,
    )
    parameters: ClassVar[frozenset[str]] = Parameters.NAMES
    options: BallisticOptions

    # ------------------------------------------------------------------ what it is

    @classmethod
    def availability(cls) -> Availability:
        """Numpy is all it needs."""
        return Availability(True, __version__)

    @classmethod
    def options_model(cls) -> type[BallisticOptions]:
        """The engine's options."""
        return BallisticOptions

    @property
    def version(self) -> str:
        """With the option that shapes trajectories: a snapshot made with other steps would not go on exactly."""
        return f"{self.availability().version} (rotation_steps={self.options.rotation_steps})"

    # ------------------------------------------------------------------ lifecycle

    def _build(self, world: World, num_envs: int) -> None:
        kinds = [body.kind for body in world.bodies]
        self._moving = np.array([i for i, kind in enumerate(kinds) if kind is BodyKind.FREE], dtype=int)
        self._tables = Parameters(world, num_envs, self._moving)
        self._pose = np.zeros((num_envs, len(kinds), 7))
        self._twist = np.zeros((num_envs, len(kinds), 6))
        self._wrench = np.zeros((num_envs, len(kinds), 6))

    def _free(self) -> None:
        for name in ("_moving", "_tables", "_pose", "_twist", "_wrench"):
            vars(self).pop(name, None)

    def _reset(self, ids: Array) -> None:
        self._pose[ids] = self.world.initial_body_pose
        self._twist[ids] = 0.0

    # ------------------------------------------------------------------ stepping

    def _step(self, n_steps: int, ids: Array | None) -> None:
        rows = np.ix_(self._all if ids is None else ids, self._moving)
        self._pose[rows], self._twist[rows] = self._run(n_steps, rows)

    def _run(self, n_steps: int, rows: tuple[Array, ...]) -> tuple[Array, Array]:
        """Poses and twists of the moving bodies of some envs, n steps on."""
        pose, twist, wrench = self._pose[rows], self._twist[rows], self._wrench[rows]
        body = Constants(*(part[rows[0][:, 0]] for part in self._tables.constants()))
        with np.errstate(all="ignore"):  # what overflows shows in State.fault, and the other envs go on
            for _ in range(n_steps):
                pose, twist = advance(pose, twist, wrench, body, self.world.physics.dt, self.options.rotation_steps)
        return pose, twist

    def _apply_wrench(self, wrench: Array | None) -> None:
        self._wrench[...] = 0.0 if wrench is None else wrench

    def _apply_control(self, control: Control) -> None:
        pass  # there are no joints, so there is no drive

    # ------------------------------------------------------------------ reading and writing

    def _read(self, name: str) -> Array:
        if name == "body_pose":
            return self._pose.copy()
        if name == "body_twist":
            return self._twist.copy()
        if name == "fault":
            state = np.concatenate([self._pose, self._twist], axis=-1)
            return np.asarray(~np.isfinite(state).all(axis=(1, 2)))
        if name == "contact_force":
            return np.zeros((self.num_envs, 0, 3))  # a world with contact sensors was refused
        return np.zeros((self.num_envs, 0))  # joint_pos, joint_vel, joint_effort: one with joints as well

    def _write_joints(self, ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
        pass  # there are none

    def _write_bodies(self, ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        if pose is not None:
            self._pose[np.ix_(ids, bodies)] = pose
        if twist is not None:
            self._twist[np.ix_(ids, bodies)] = twist

    # ------------------------------------------------------------------ parameters

    def _get_parameter(self, name: str) -> Array:
        return self._tables.values[name]

    def _set_parameter(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        self._tables.write(name, values, ids, indices)

    def _default_parameter(self, name: str) -> Array:
        return self._tables.defaults[name]

    # ------------------------------------------------------------------ snapshots

    def _snapshot(self, ids: Array, level: SnapshotLevel) -> dict[str, Array]:
        return {"pose": self._pose[ids], "twist": self._twist[ids]}

    def _restore(self, ids: Array, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        self._pose[ids], self._twist[ids] = data["pose"], data["twist"]

    # ------------------------------------------------------------------ benchmarks

    def raw_loop(self) -> Callable[[int], None]:
        """The arithmetic alone."""
        rows = np.ix_(self._all, self._moving)

        def loop(n_steps: int) -> None:
            self._run(n_steps, rows)

        return loop

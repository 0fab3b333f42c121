"""MuJoCo as a SimEngine: `num_envs` simulations of one model in a `mujoco.batch.Batch`."""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import mujoco
import numpy as np
from mujoco.batch import SimulationError

from anysim.conventions import Array, wxyz_from_xyzw, xyzw_from_wxyz
from anysim.engine.availability import Finding, Health
from anysim.engine.base import SimEngine
from anysim.engine.cameras import CameraView
from anysim.engine.capability import Capabilities
from anysim.engine.control import Control, alternating
from anysim.engine.presence import Lifecycle
from anysim.engine.state import ContactPoints, RayHits, SnapshotLevel
from anysim.math import pose as P
from anysim.model.world import World
from anysim_mujoco import declared
from anysim_mujoco.audit import geom_volumes, joint_limits
from anysim_mujoco.carry import carried_rows, take_rows
from anysim_mujoco.log import silence
from anysim_mujoco.options import MujocoOptions
from anysim_mujoco.parameters import Parameters
from anysim_mujoco.raw import raw_loop
from anysim_mujoco.simulations import Simulations

_VELOCITY_STAGE = mujoco.mjtStage.mjSTAGE_VEL.value
"""After the last substep frames and velocities are brought up to date, which leaves the trajectory as it is."""


class MujocoEngine(SimEngine):
    """The engine `mujoco`. Trajectories do not depend on the number of envs, their order or the threads."""

    name: ClassVar[str] = "mujoco"
    capabilities: ClassVar[Capabilities] = declared.CAPABILITIES
    parameters: ClassVar[frozenset[str]] = Parameters.NAMES
    lifecycle: ClassVar[Lifecycle] = Lifecycle.P2
    parallel: ClassVar[bool] = True  # a Batch steps its envs in C threads, without Python's lock
    library = declared.LIBRARY
    options_type = MujocoOptions
    options: MujocoOptions

    @classmethod
    def share_of_threads(cls, options: Mapping[str, Any], threads: int) -> dict[str, Any]:
        """A Batch takes all cores unless it is told otherwise."""
        return {**options, "threads": options.get("threads") or threads}

    @classmethod
    def findings(cls) -> tuple[Finding, ...]:
        """Threads, and versions that are refused."""
        return (
            Finding(
                "mujoco: threads", Health.NOTE, f"{MujocoOptions().thread_count(1 << 30)} at most: one per env and CPU"
            ),
            Finding("mujoco: versions", Health.NOTE, str(declared.LIBRARY)),
        )

    # ------------------------------------------------------------------ lifecycle

    def _build(self, world: World, num_envs: int) -> None:
        silence()
        self._sims = Simulations(world, num_envs, self._presence.varies, self.options)
        self._painter: Any = None

    def _free(self) -> None:
        if self._painter is not None:
            self._painter.close()
        del self._sims, self._painter

    def _reset(self, ids: Array) -> None:
        self._sims.rows[ids] = self._sims.initial
        if self._sims.retired is not None:
            self._sims.retired.uncouple(ids)
        self._sims.reader.clear_faults(ids)
        self._sims.reader.hold(ids, 0.0, 0.0)

    def _populate(self, ids: Array) -> None:
        if self._sims.retired is not None:
            self._sims.retired.populate(ids, self._presence.entities[ids])

    # ------------------------------------------------------------------ stepping

    def _step(self, n_steps: int, ids: Array | None) -> None:
        self._sims.parameters.settle()
        rows = None if ids is None else np.sort(ids)
        if self._sims.drives.limited or self._sims.dampers.active:
            self._step_one_by_one(n_steps, rows)
        else:
            self._advance(rows, n_steps)
        if self._sims.retired is not None:
            self._sims.retired.rest()
        self._sims.reader.stepped(ids)

    def _step_one_by_one(self, n_steps: int, rows: Array | None) -> None:
        """What depends on the state of each substep and MuJoCo does not have."""
        held, inertials = self._sims.dampers.hold(), self._sims.parameters.inertials()
        for _ in range(n_steps):
            if self._sims.drives.limited:
                self._sims.drives.limit()
            if self._sims.dampers.active:
                self._sims.dampers.push(held, *inertials)
            self._advance(rows, 1)
        self._sims.dampers.put(held)

    def _advance(self, rows: Array | None, n_steps: int) -> None:
        try:
            self._sims.batch.step(rows, n_steps, _VELOCITY_STAGE)
        except SimulationError as error:
            self._sims.reader.failed[error.ids] = True

    def _read(self, name: str) -> Array:
        self._sims.parameters.settle()
        return self._sims.fields[name]()

    def _apply_control(self, control: Control) -> None:
        self._sims.drives.apply(control)

    def _apply_wrench(self, wrench: Array | None) -> None:
        if wrench is None:
            self._sims.wrenches[...] = 0.0
        else:
            self._sims.wrenches[:, self._sims.layout.bodies] = wrench

    # ------------------------------------------------------------------ writing

    def _write_joints(self, ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
        self._sims.reader.touch(ids)
        if position is not None:
            self._sims.qpos[ids[:, None], self._sims.layout.joint_q[joints]] = position
        if velocity is not None:
            self._sims.qvel[ids[:, None], self._sims.layout.joint_v[joints]] = velocity

    def _write_bodies(self, ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        self._sims.reader.touch(ids)
        rows = ids[:, None, None]
        static, free = self._sims.layout.static_row[bodies], self._sims.layout.free_row[bodies]
        if pose is not None and (fixed := static >= 0).any():
            at = ids[:, None], self._sims.layout.mocap[static[fixed]]
            self._sims.mocap_pos[at] = pose[:, fixed, :3]
            self._sims.mocap_quat[at] = wxyz_from_xyzw(pose[:, fixed, 3:])
        if not (loose := free >= 0).any():
            return
        q, v = self._sims.layout.free_q[free[loose]], self._sims.layout.free_v[free[loose]]
        if pose is not None:
            self._sims.qpos[rows, q[None, :, :3]] = pose[:, loose, :3]
            self._sims.qpos[rows, q[None, :, 3:]] = wxyz_from_xyzw(pose[:, loose, 3:])
        if twist is not None:
            turned = xyzw_from_wxyz(self._sims.qpos[rows, q[None, :, 3:]])
            self._sims.qvel[rows, v[None, :, :3]] = twist[:, loose, :3]
            # MuJoCo keeps the angular rate of a free body in its own axes
            self._sims.qvel[rows, v[None, :, 3:]] = P.rotate_inverse(turned, twist[:, loose, 3:])

    # ------------------------------------------------------------------ parameters and snapshots

    def _get_parameter(self, name: str) -> Array:
        return self._sims.parameters.get(name)

    def _set_parameter(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        self._sims.parameters.set(name, values, ids, indices)
        self._sims.reader.touch(ids)

    def _default_parameter(self, name: str) -> Array:
        return self._sims.parameters.default(name)

    def _snapshot(self, ids: Array, level: SnapshotLevel) -> dict[str, Array]:
        reader = self._sims.reader
        return {
            "rows": self._sims.rows[ids],
            "effort": reader.joint_effort()[ids],
            "contact": reader.contact_force()[ids],
            "fault": reader.fault()[ids],
            **self._sims.parameters.rows(ids),
        }

    def _restore(self, ids: Array, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        self._sims.rows[ids] = data["rows"]
        self._sims.parameters.restore_rows(ids, data)
        self._sims.reader.clear_faults(ids)
        self._sims.reader.failed[ids] = data["fault"]
        self._sims.reader.hold(ids, data["effort"], data["contact"])

    def _carry_rows(self) -> Any:
        sims = self._sims
        return sims.layout, carried_rows(sims.batch, sims.layout, sims.reader, sims.parameters)

    def _take_rows(self, carried: Any, old: World) -> None:
        (layout, rows), sims = carried, self._sims
        take_rows(rows, old, layout, self.world, sims.batch, sims.layout, sims.reader, sims.parameters)

    def read_back(self) -> Mapping[str, Array]:
        """Limits and volumes as the compiled model has them."""
        with self._lock:
            self._require_world()
            model, layout = self._sims.model, self._sims.layout
            return {"joint.limits": joint_limits(model, layout), "geom.volume": geom_volumes(model, layout)}

    def handles(self) -> Mapping[str, int]:
        """Simulations, and the fields of the model that envs have for themselves."""
        with self._lock:
            self._require_world()
            return {"simulations": self._sims.batch.nsim, "fields": len(self._sims.batch._expanded)}  # noqa: SLF001

    def raw_loop(self) -> Callable[[int], None]:
        """MuJoCo's own batch, stepped without this engine."""
        with self._lock:
            self._require_world()
            self._sims.parameters.settle()
            self._flush_control()
            first, second = alternating(self._commands.control)
            inputs = [self._sims.drives.input_for(control) for control in (second, first)]
            return raw_loop(self._sims.batch, inputs[::-1])

    # ------------------------------------------------------------------ sensing

    def renderer_name(self) -> str:
        """Backend, driver and antialiasing: `egl: llvmpipe (LLVM 15.0.6, 256 bits), in software, no antialiasing`."""
        from anysim_mujoco.gl import gl_thread

        thread = gl_thread()
        thread.open(self.options.gl)
        software = thread.in_software()
        samples = self.options.samples(software)
        where = "in software" if software else "on the GPU"
        quality = f"{samples} samples per pixel" if samples else "no antialiasing"
        return f"{thread.backend}: {thread.driver()}, {where}, {quality}"

    def _raycast(self, origins: Array, directions: Array, ids: Array) -> RayHits:
        self._sims.parameters.settle()
        return self._sims.queries.raycast(origins, directions, ids)

    def _contacts(self, ids: Array) -> ContactPoints:
        self._sims.parameters.settle()
        self._flush_control()
        return self._sims.queries.contacts(ids)

    def _flush_control(self) -> None:
        """Show MuJoCo commands that wait for the next step."""
        if self._commands.control_changed:
            self._apply_control(self._commands.control)
            self._commands.control_changed = False

    def _render(self, view: CameraView, ids: Array, channels: tuple[str, ...]) -> dict[str, Array]:
        from anysim_mujoco.render import Painter

        self._sims.parameters.settle()
        if self._painter is None:
            sims = self._sims
            self._painter = Painter(sims.model, sims.layout, sims.queries, sims.looks, self.options)
        return self._painter.draw(view, ids, channels)

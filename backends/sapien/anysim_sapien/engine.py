"""SAPIEN as a SimEngine: one scene per env, stepped one after the other on the CPU."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.cameras import CameraView
from anysim.engine.capability import Allowance, Capabilities
from anysim.engine.control import Control
from anysim.engine.doctor import Finding
from anysim.engine.lighting import Looks
from anysim.engine.presence import Lifecycle
from anysim.engine.state import Availability, ContactPoints, RayHits, SnapshotLevel
from anysim.errors import EngineError
from anysim.model.index import paired
from anysim.model.world import World
from anysim_sapien import declared
from anysim_sapien.audit import geom_volumes, joint_limits
from anysim_sapien.carry import Carried
from anysim_sapien.contacts import contact_points
from anysim_sapien.meeting import refusals
from anysim_sapien.momentum import Momentum
from anysim_sapien.motion import Motion, motion_of, motions_of, put_motion, put_twist, twists_of
from anysim_sapien.native import drives_of
from anysim_sapien.options import OWN_SCENERY, SapienOptions
from anysim_sapien.parameters import LIT, LOOKS, Parameters
from anysim_sapien.raw import raw_loop
from anysim_sapien.rays import cast
from anysim_sapien.recipe import Recipe, Recipes
from anysim_sapien.scene import EnvScene
from anysim_sapien.state import StateReader
from anysim_sapien.stepping import advance, pasts_of, refuse_pasts, relive, wrenches

SKINS = ("color", "texture", "material")

_BUILT = (
    "_recipes",
    "_layout",
    "_drives",
    "_looks",
    "_parameters",
    "_momentum",
    "_reader",
    "_fields",
    "_wrench",
    "_scenes",
)
"""What `_build` makes and `_free` lets go of."""


class SapienEngine(SimEngine):
    """The engine `sapien`. Trajectories do not depend on the number of envs or their order."""

    name: ClassVar[str] = "sapien"
    capabilities: ClassVar[Capabilities] = declared.CAPABILITIES
    parameters: ClassVar[frozenset[str]] = Parameters.NAMES
    lifecycle: ClassVar[Lifecycle] = Lifecycle.P1
    audit_allowances: ClassVar[Mapping[str, Allowance]] = declared.AUDIT_ALLOWANCES
    options: SapienOptions

    @classmethod
    def availability(cls) -> Availability:
        """By the installed version alone; imports nothing."""
        return declared.LIBRARY.availability()

    @classmethod
    def options_model(cls) -> type[SapienOptions]:
        """The engine's options."""
        return SapienOptions

    @classmethod
    def findings(cls) -> tuple[Finding, ...]:
        """The Vulkan driver and how to choose one; threads."""
        from anysim_sapien.diagnosis import findings

        return findings()

    @classmethod
    def refusals(cls, world: World) -> Sequence[str]:
        """Pairs of surfaces and exclusions that PhysX' filters cannot tell apart."""
        return refusals(world)

    # ------------------------------------------------------------------ lifecycle

    def _build(self, world: World, num_envs: int) -> None:
        self._recipes = Recipes(world, self.options)
        self._layout = self._recipes.layout
        self._scenes: list[EnvScene] = []
        self._drives = drives_of(world, num_envs)
        self._looks = Looks(world, num_envs, OWN_SCENERY)
        self._parameters = Parameters(
            world, self._layout, self._drives, self._scenes, self._rebuild_env, num_envs, self._looks
        )
        for env in range(num_envs):
            self._scenes.append(EnvScene(self._recipe(env), self._parameters.values(env)))
        self._momentum = Momentum(self._recipes, num_envs)
        self._reader = StateReader(world, self._scenes, self._drives, self._momentum)
        self._fields = self._reader.fields
        self._wrench: Array | None = None
        self._painter: Any = None

    def _free(self) -> None:
        painter = vars(self).pop("_painter", None)
        if painter is not None:
            painter.close()
        for name in _BUILT:
            vars(self).pop(name, None)

    def _recipe(self, env: int) -> Recipe:
        return self._recipes.of(self._presence.entities[env])

    def _populate(self, ids: Array) -> None:
        """Nothing yet: a reset builds the scene of an env anew, with what is there. Here it fails where that cannot."""
        for env in ids:
            values = self._parameters.values(int(env))
            self._recipe(int(env)).copies(values.geom_friction, values.geom_restitution)

    def _reset(self, ids: Array) -> None:
        for env in ids:
            self._renew(int(env))
            self._reader.hold_contact(int(env), 0.0)
            self._reader.written(int(env))
            self._drives.hold_effort(int(env), 0.0)

    def _renew(self, env: int) -> None:
        """A new scene for an env, in the initial state: a used one would remember contacts."""
        self._scenes[env] = EnvScene(self._recipe(env), self._parameters.values(env))
        self._drives.forget(env)
        self._momentum.forget(env)

    def _rebuild_env(self, env: int) -> None:
        """A new scene for an env, in its present state."""
        self._reader.keep_contact(env)
        self._place(env, motion_of(self._scenes[env]))
        self._reader.written(env)

    def _place(self, env: int, motion: Motion) -> None:
        """A new scene for an env, in a given state."""
        self._renew(env)
        put_motion(self._scenes[env], motion)
        self._scenes[env].journal.base()

    # ------------------------------------------------------------------ stepping

    def _step(self, n_steps: int, ids: Array | None) -> None:
        for env in range(self.num_envs) if ids is None else ids.tolist():
            self._step_env(env, n_steps)

    def _step_env(self, env: int, n_steps: int) -> None:
        pushes = None if self._wrench is None else wrenches(self._wrench[env], self._layout.fixed)
        while n_steps:
            room = self.options.rebase_steps - self._scenes[env].journal.steps
            if room <= 0:
                self._place(env, motion_of(self._scenes[env]))
                continue
            advance(self._scenes[env], self._drives, self._momentum, env, pushes, min(n_steps, room))
            n_steps -= min(n_steps, room)
        self._reader.stepped(env)

    def _read(self, name: str) -> Array:
        return self._fields[name]()

    def _apply_control(self, control: Control) -> None:
        self._drives.apply(control)

    def _apply_wrench(self, wrench: Array | None) -> None:
        self._wrench = wrench

    # ------------------------------------------------------------------ writing

    def _write_joints(self, ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
        for row, env in enumerate(ids):
            scene = self._scenes[env]
            full_position = full_velocity = None
            if position is not None:
                full_position = scene.joint_positions()
                full_position[joints] = position[row]
            if velocity is not None:
                full_velocity = scene.joint_velocities()
                full_velocity[joints] = velocity[row]
            scene.place_joints(full_position, full_velocity)
            self._written(int(env))

    def _write_bodies(self, ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        for row, env in enumerate(ids):
            scene = self._scenes[env]
            turn = scene.poses()[bodies, 3:]
            moved = self._layout.free[bodies]
            rows = None if twist is None else twist[row]
            if pose is not None:
                if rows is None:
                    # the origin keeps its velocity; PhysX would keep that of the centre of mass
                    rows = np.zeros((len(bodies), 6))
                    if moved.any():
                        rows[moved] = twists_of(scene, bodies[moved], turn[moved])
                for body, place in zip(bodies, pose[row], strict=True):
                    scene.place_body(int(body), place)
                turn = scene.poses()[bodies, 3:]
            if rows is not None:
                for column in np.flatnonzero(moved):
                    put_twist(scene, int(bodies[column]), rows[column], turn[column])
            self._written(int(env))

    def _written(self, env: int) -> None:
        self._reader.written(env)
        self._bound(env)

    def _bound(self, env: int) -> None:
        """What is written again and again and never stepped has its scene built anew, too."""
        if self._scenes[env].journal.writes > self.options.rebase_steps:
            self._rebuild_env(env)

    # ------------------------------------------------------------------ parameters and snapshots

    def _get_parameter(self, name: str) -> Array:
        return self._parameters.get(name)

    def _set_parameter(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        if self.options.shader == "trivial" and name in LIT:
            raise EngineError(
                f"sapien's shader 'trivial' draws no light: {name} is not seen; choose options.shader: lit"
            )
        self._parameters.set(name, values, ids, indices)
        if name in LOOKS:
            return
        for env in ids:
            self._bound(int(env))

    def _default_parameter(self, name: str) -> Array:
        return self._parameters.default(name)

    def _snapshot(self, ids: Array, level: SnapshotLevel) -> dict[str, Array]:
        scenes = [self._scenes[env] for env in ids]
        data = pasts_of(scenes) if level is SnapshotLevel.TRAJECTORY else motions_of(scenes)
        return data | {"effort": self._drives.effort()[ids]} | self._reader.rows(ids) | self._parameters.rows(ids)

    @classmethod
    def refuse_rows(cls, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        if level is SnapshotLevel.TRAJECTORY:
            refuse_pasts(data)

    def _restore(self, ids: Array, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        self._parameters.put_rows(ids, data)
        for row, env in enumerate(ids.tolist()):
            if level is SnapshotLevel.TRAJECTORY:
                self._scenes[env], drives, momentum = relive(self._recipe(env), data, row)
                self._drives.adopt(env, drives.given(0))
                self._momentum.adopt(env, momentum.noted(0))
            else:
                self._place(env, Motion(*(data[name][row] for name in Motion._fields)))
            self._reader.put_rows(env, data, row)
            self._drives.hold_effort(env, data["effort"][row])

    def _carry_rows(self) -> Any:
        reader = self._reader
        return Carried(reader.body_pose(), reader.body_twist(), reader.joint_effort(), reader.contact_force())

    def _take_rows(self, carried: Any, old: World) -> None:
        new = self.world
        before, after = paired(old, new, "bodies")
        joints_before, joints_after = paired(old, new, "joints")
        sensors_before, sensors_after = paired(old, new, "contact_sensors")
        for env in range(self.num_envs):
            self._reader.hold_motion(env, after, carried.pose[env, before], carried.twist[env, before])
            self._drives.hold_effort(env, carried.effort[env, joints_before], joints_after)
            contact = np.zeros((len(new.contact_sensors), 3))
            contact[sensors_after] = carried.contact[env, sensors_before]
            self._reader.hold_contact(env, contact)

    def read_back(self) -> Mapping[str, Array]:
        """Limits and volumes as PhysX has them."""
        with self._lock:
            self._require_world()
            return {
                "joint.limits": joint_limits(self._scenes[0]),
                "geom.volume": geom_volumes(self.world, self._scenes[0]),
            }

    def handles(self) -> Mapping[str, int]:
        """Scenes that are alive in this process, and the entities in those of this engine."""
        with self._lock:
            self._require_world()
            entities = sum(len(scene.scene.entities) for scene in self._scenes)
            return {"scenes": len(EnvScene.alive), "entities": entities}

    def raw_loop(self) -> Callable[[int], None]:
        """SAPIEN's own loop, stepped without this engine."""
        with self._lock:
            self._require_world()
            values = [self._parameters.values(env) for env in range(self.num_envs)]
            motions = [motion_of(scene) for scene in self._scenes]
            return raw_loop(self.world, self.options, self.presence, values, motions, self._drives, self.control)

    # ------------------------------------------------------------------ sensing

    def renderer_name(self) -> str:
        """The Vulkan device, such as `SwiftShader Device (Subzero), in software`."""
        from anysim_sapien.vulkan import open_device

        device = open_device(self.options.vulkan_icd)
        return f"{device.name}, {'in software' if device.is_cpu else 'on the GPU'}"

    def _raycast(self, origins: Array, directions: Array, ids: Array) -> RayHits:
        return cast(self._scenes, self._layout, origins, directions, ids)

    def _contacts(self, ids: Array) -> ContactPoints:
        return contact_points(self.world, self._scenes, self._momentum, ids)

    def _render(self, view: CameraView, ids: Array, channels: tuple[str, ...]) -> dict[str, Array]:
        from anysim_sapien.render import Painter

        if self._painter is None:
            self._painter = Painter(self.world, self._layout, self._looks, self.options)
        there = self._presence.bodies[ids]
        skins = tuple(self._parameters.get(f"geom.{name}")[ids] for name in SKINS)
        return self._painter.draw(view, ids, skins, there, channels)

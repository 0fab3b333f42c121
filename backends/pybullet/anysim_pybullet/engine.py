"""PyBullet as a SimEngine: a DIRECT client for each env, stepped one after the other."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.cameras import CameraView
from anysim.engine.capability import Allowance, Capabilities
from anysim.engine.control import Control
from anysim.engine.doctor import Finding, Health
from anysim.engine.presence import Lifecycle
from anysim.engine.state import Availability, ContactPoints, RayHits, SnapshotLevel
from anysim.model.world import World
from anysim_pybullet import declared
from anysim_pybullet.options import PybulletOptions

if TYPE_CHECKING:
    from anysim_pybullet.render import Painter


class PybulletEngine(SimEngine):
    """The engine `pybullet`. Trajectories do not depend on the number of envs or their order."""

    name: ClassVar[str] = "pybullet"
    capabilities: ClassVar[Capabilities] = declared.CAPABILITIES
    parameters: ClassVar[frozenset[str]] = declared.PARAMETERS
    lifecycle: ClassVar[Lifecycle] = Lifecycle.P1
    audit_allowances: ClassVar[Mapping[str, Allowance]] = declared.AUDIT_ALLOWANCES
    options: PybulletOptions

    @classmethod
    def availability(cls) -> Availability:
        """By the installed version alone; imports nothing."""
        return declared.LIBRARY.availability()

    @classmethod
    def options_model(cls) -> type[PybulletOptions]:
        """The engine's options."""
        return PybulletOptions

    @classmethod
    def findings(cls) -> tuple[Finding, ...]:
        """Threads."""
        words = "one per process, it keeps the interpreter's lock: `shards` uses more"
        return (Finding("pybullet: threads", Health.NOTE, words),)

    # ------------------------------------------------------------------ lifecycle

    def _build(self, world: World, num_envs: int) -> None:
        # imported here, so that the engine can say that it is not available where PyBullet is not installed
        from anysim_pybullet.envs import Envs

        self._painter: Painter | None = None
        self._envs: Envs = Envs(world, self._presence.entities, self.options)

    def _free(self) -> None:
        if self._painter is not None:
            self._painter.close()
        self._envs.close()
        del self._envs, self._painter

    def _populate(self, ids: Array) -> None:
        self._envs.populate(ids, self._presence.entities[ids])

    def _reset(self, ids: Array) -> None:
        self._envs.reset(ids)

    # ------------------------------------------------------------------ stepping

    def _step(self, n_steps: int, ids: Array | None) -> None:
        self._envs.step(n_steps, ids)

    def _read(self, name: str) -> Array:
        return self._envs.mirror.field(name)

    def _apply_control(self, control: Control) -> None:
        self._envs.laws.apply(control)

    def _apply_wrench(self, wrench: Array | None) -> None:
        self._envs.laws.wrench = wrench

    # ------------------------------------------------------------------ writing

    def _write_joints(self, ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
        self._envs.write_joints(ids, joints, position, velocity)

    def _write_bodies(self, ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        self._envs.write_bodies(ids, bodies, pose, twist)

    # ------------------------------------------------------------------ parameters and snapshots

    def _get_parameter(self, name: str) -> Array:
        return self._envs.parameters.get(name)

    def _set_parameter(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        self._envs.parameters.set(name, values, ids, indices)
        if name.startswith(("actuator.", "joint.")) or name == "body.com":  # which gives the env a new client
            self._commands.control_changed = True

    def _default_parameter(self, name: str) -> Array:
        return self._envs.parameters.default(name)

    def _snapshot(self, ids: Array, level: SnapshotLevel) -> dict[str, Array]:
        return self._envs.snapshot(ids, level)

    def _restore(self, ids: Array, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        self._envs.restore(ids, data, level)

    def _carry_rows(self) -> Any:
        return self._envs.carried()

    def _take_rows(self, carried: Any, old: World) -> None:
        self._envs.take(carried, old)

    def read_back(self) -> Mapping[str, Array]:
        """Joint limits, volumes, masses, centres of mass and inertias as Bullet has them."""
        from anysim_pybullet.audit import geom_volumes, inertials, joint_limits

        with self._lock:
            self._require_world()
            env = self._envs.clients[0]
            return {"joint.limits": joint_limits(env), "geom.volume": geom_volumes(env), **inertials(env)}

    def handles(self) -> Mapping[str, int]:
        """Clients that are open in this process, and the bodies and constraints in those of this engine."""
        from anysim_pybullet.audit import handles

        with self._lock:
            self._require_world()
            return handles(self._envs.clients)

    def raw_loop(self) -> Callable[[int], None]:
        """Bullet's own loop, stepped without this engine."""
        from anysim_pybullet.raw import raw_loop

        with self._lock:
            self._require_world()
            return raw_loop(self._envs, self.control)

    # ------------------------------------------------------------------ sensing

    def renderer_name(self) -> str:
        """What draws the images."""
        return "TinyRenderer, in software"

    def _raycast(self, origins: Array, directions: Array, ids: Array) -> RayHits:
        from anysim_pybullet.contacts import raycast

        return raycast(self.world, self._envs.clients, origins, directions, ids)

    def _contacts(self, ids: Array) -> ContactPoints:
        from anysim_pybullet.contacts import contact_points

        return contact_points(self._envs.clients, ids)

    def _render(self, view: CameraView, ids: Array, channels: tuple[str, ...]) -> dict[str, Array]:
        from anysim_pybullet.render import Painter

        if self._painter is None:
            self._painter = Painter(self.world, self._envs.parameters.looks)
        there, looks = self._presence.bodies, self._envs.parameters
        return self._painter.draw(view, looks.color, looks.texture, there, ids, channels)

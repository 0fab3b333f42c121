"""SimEngine: the one interface of all physics engines.

The public methods here check, lock, cache and account; a backend writes the primitives of
`anysim.engine.primitives` (names with a leading underscore). `num_envs` copies of one World are stepped together, each
with its own state.
"""

import threading
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np

from anysim.conventions import Array
from anysim.engine import arguments, world_state_io, write
from anysim.engine.cameras import CameraRig
from anysim.engine.capability import Allowance, Capabilities, Capability, Need, check
from anysim.engine.control import CommandBuffer, Control
from anysim.engine.doctor import Finding
from anysim.engine.drive_checks import check_drives
from anysim.engine.presence import Lifecycle, Presence
from anysim.engine.primitives import Primitives
from anysim.engine.requirements import needs_of
from anysim.engine.snapshot import put_back, refuse_foreign, take as take_snapshot
from anysim.engine.state import Availability, ContactPoints, RayHits, Snapshot, SnapshotLevel, State
from anysim.engine.world_state import Carried, Missing, WorldState
from anysim.errors import CapabilityError, EngineError, listing
from anysim.model.index import Index
from anysim.model.world import ControlMode, World

EnvIds = Sequence[int] | Array | None
"""Which envs: None for all, else unique indices."""

Indices = Sequence[int] | Array | None
"""Which joints, bodies, actuators…: None for all, else unique indices."""


class SimEngine(Primitives):
    """A physics engine that holds `num_envs` sub-environments of one World."""

    name: ClassVar[str]
    capabilities: ClassVar[Capabilities]
    parameters: ClassVar[frozenset[str]] = frozenset()
    """The names of `anysim.engine.parameters` that the engine can change per env."""
    lifecycle: ClassVar[Lifecycle] = Lifecycle.P3
    """What it can do with an entity after the build; all but P3 goes with Capability.VARYING_ENTITIES."""
    parallel: ClassVar[bool] = False
    """Whether it steps its envs on several cores by itself, so that more processes (`shards: auto`) gain nothing."""
    audit_allowances: ClassVar[Mapping[str, Allowance]] = {}
    """By quantity of the audit what the engine declares to be off; all else is taken over to single precision."""

    def __init__(self, **options: Any) -> None:
        """Options are those of `options_model`; a wrong one raises EngineError with what exists."""
        self.options = arguments.validated_options(self.name, self.options_model(), options)
        self._lock = threading.RLock()
        self._world: World | None = None
        self._destroyed = False

    # ------------------------------------------------------------------ what it is

    @classmethod
    @abstractmethod
    def availability(cls) -> Availability:
        """Whether it can run here. Imports nothing heavy and never raises."""

    @classmethod
    def options_model(cls) -> Any:
        """The pydantic model of the engine's options, or None if it has none."""
        return None

    @classmethod
    def findings(cls) -> Sequence[Finding]:
        """What else `anysim doctor` should say of the engine on this machine: threads, drivers, versions to avoid."""
        return ()

    @classmethod
    def share_of_threads(cls, options: Mapping[str, Any], threads: int) -> dict[str, Any]:
        """The options of one of several processes that share the machine, each to use about that many threads.

        What the user chose stays. They must not change results.
        """
        del threads
        return dict(options)

    @classmethod
    def refusals(cls, world: World) -> Sequence[str]:
        """Why this world in particular cannot be built, beyond capabilities: a reason each. Imports nothing heavy."""
        return ()

    @property
    def version(self) -> str:
        """The version of the physics engine, as it stamps snapshots."""
        return self.availability().version

    @property
    def world(self) -> World:
        """The World it runs."""
        self._require_world()
        assert self._world is not None
        return self._world

    # ------------------------------------------------------------------ lifecycle

    def create_world(self, world: World, num_envs: int = 1) -> Self:
        """Build `num_envs` copies of a World and reset them all.

        Raises:
            CapabilityError: the world needs what the engine does not have; nothing was built.
            EngineError: there is a world already, or the engine was destroyed.
        """
        with self._lock:
            if self._destroyed:
                raise EngineError(f"this {self.name} engine was destroyed; make a new one")
            if self._world is not None:
                raise EngineError(f"this {self.name} engine has a world already; destroy() it or make another engine")
            if num_envs < 1:
                raise EngineError(f"num_envs must be at least 1, got {num_envs}")
            self.approximations: list[Need] = self._check(world)
            check_drives(world)
            self.num_envs = num_envs
            self._install(world)
            try:
                self._build(world, num_envs)
                if self._presence.varies:
                    self._populate(self._all)
            except BaseException:
                self._world = None
                raise
            self._reset_rows(self._all)
            return self

    def _check(self, world: World) -> list[Need]:
        return check(self.name, self.capabilities, needs_of(world), f"'{world.name}'", self.refusals(world))

    def _install(self, world: World) -> None:
        """Everything the base class keeps about a world."""
        self._world = world
        self._dt = world.physics.dt
        self.index = Index(world)
        self._all = np.arange(self.num_envs)
        self._ticks = np.zeros(self.num_envs, dtype=np.int64)
        self._state: State | None = None
        self._commands = CommandBuffer(world, self.num_envs)
        self._rig = CameraRig(world, self.num_envs)
        self._presence = Presence(world, self.num_envs)
        self._changed: dict[str, None] = {}

    def destroy(self) -> None:
        """Free the world. May be called any number of times."""
        with self._lock:
            if self._world is not None:
                self._retire_state()
                self._free()
                self._world = None
            self._destroyed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()

    # ------------------------------------------------------------------ stepping

    def reset(self, env_ids: EnvIds = None, present: Any = None) -> None:
        """Put envs into the World's initial state; commands return to holding it. Parameters stay as they are.

        Args:
            env_ids: which envs.
            present: (E, entities) bool, what is there from now on; None leaves it as it is. What is in no slot of the
                World is always there, and of each slot at most one entity.

        Raises:
            CapabilityError: what is there was to change, and the engine cannot change it.
            EngineError: rows that no env can have; nothing was changed.
        """
        with self._lock:
            self._require_world()
            ids = self._ids(env_ids)
            if present is not None:
                self._admit(ids, self._presence.checked(present, ids))
            self._reset_rows(ids)

    def _admit(self, ids: Array, present: Array) -> Array:
        """Change who is there; returns the envs where that is another than before, which then need a reset."""
        changed = self._presence.changed(ids, present)
        if len(changed):
            self._require(Capability.VARYING_ENTITIES)
            self._retire_state()
            before = self._presence.entities[ids]
            self._presence.write(ids, present)
            try:
                self._populate(changed)
            except BaseException:
                self._presence.write(ids, before)
                self._populate(changed)  # of several envs or workers some may have gone on to the new one
                raise
        return changed

    @property
    def presence(self) -> Array:
        """(N, entities) bool: which of the World's entities are there. Bodies of the others read as the world's frame.

        What is written to them has no effect but for parameters, which wait for them.
        """
        with self._lock:
            self._require_world()
            return self._presence.entities.copy()

    def _reset_rows(self, ids: Array) -> None:
        self._retire_state()
        self._commands.reset(ids)
        self._reset(ids)
        self._ticks[ids] = 0

    def step(self, n_steps: int = 1, env_ids: EnvIds = None, *, keep_wrench: bool = False) -> None:
        """Advance by `n_steps` physics steps of `world.physics.dt`; with `env_ids`, only those envs.

        Commands persist; a wrench lasts for the next call that steps its env, and with `keep_wrench` for the one after
        it too, where a control step is made in parts. A non-finite env is marked in `State.fault`, the others go on.
        """
        with self._lock:
            self._require_world()
            if n_steps < 1:
                raise EngineError(f"n_steps must be at least 1, got {n_steps}")
            ids = None if env_ids is None else self._ids(env_ids)
            self._retire_state()
            commands = self._commands
            if commands.control_changed:
                self._apply_control(commands.control)
                commands.control_changed = False
            if commands.wrench is not None:
                self._apply_wrench(commands.wrench)
            self._step(n_steps, ids)
            if commands.wrench is not None and not keep_wrench:
                commands.spend_wrench(ids)
                self._apply_wrench(None)  # what waits for others comes with their step, unless a reset forgets it
            if ids is None:
                self._ticks += n_steps
            else:
                self._ticks[ids] += n_steps

    def get_state(self) -> State:
        """The state of all envs now: read lazily, cached until the engine moves on."""
        with self._lock:
            if self._state is None:
                self._require_world()
                self._state = State(self._read_locked, self._ticks * self._dt)
            return self._state

    def _read_locked(self, name: str) -> Array:
        with self._lock:
            array = self._read(name)
            if self._presence.varies:
                self._presence.blank(name, array)
            return array

    def _retire_state(self) -> None:
        if self._state is not None:
            self._state.retire()
            self._state = None

    # ------------------------------------------------------------------ writing

    def set_joint_state(
        self, position: Any = None, velocity: Any = None, env_ids: EnvIds = None, joints: Indices = None
    ) -> None:
        """Write joint positions and velocities (E, K); mimic joints follow their leaders. Commands stay."""
        with self._lock:
            self._require_world()
            write.write_joints(self, position, velocity, self._ids(env_ids), joints)

    def set_body_state(
        self, pose: Any = None, twist: Any = None, env_ids: EnvIds = None, bodies: Indices = None
    ) -> None:
        """Write poses (E, K, 7) and twists (E, K, 6) of root bodies: free ones, and poses of static ones.

        `bodies` defaults to all free bodies. Links move by their joints: naming one is an error.
        """
        with self._lock:
            self._require_world()
            write.write_bodies(self, pose, twist, self._ids(env_ids), bodies)

    def set_control(
        self,
        position: Any = None,
        velocity: Any = None,
        effort: Any = None,
        env_ids: EnvIds = None,
        actuators: Indices = None,
    ) -> None:
        """Write drive targets (E, K): position [rad, m], velocity [rad/s, m/s], feed-forward effort [N m, N]."""
        with self._lock:
            self._require_world()
            ids = None if env_ids is None else self._ids(env_ids)
            which = None if actuators is None else self._which(actuators, len(self.world.actuators), "actuator")
            self._commands.write(position, velocity, effort, ids, which)

    @property
    def control(self) -> Control:
        """Copies of the commands in force: targets (N, A) and modes, indices into `anysim.engine.control.MODES`."""
        with self._lock:
            self._require_world()
            return Control(*(array.copy() for array in self._commands.control))

    def set_control_mode(
        self, mode: ControlMode | str, env_ids: EnvIds = None, actuators: Sequence[int] | None = None
    ) -> None:
        """Switch drives between position, velocity and effort control."""
        with self._lock:
            self._require_world()
            needed = {m: Capability(f"control: {m}") for m in ControlMode}[ControlMode(mode)]
            self._require(needed)
            which = self._which(actuators, len(self.world.actuators), "actuator")
            self._commands.set_mode(ControlMode(mode), self._ids(env_ids), which)

    def apply_wrench(self, wrench: Any, bodies: Sequence[int], env_ids: EnvIds = None) -> None:
        """Forces and torques (E, K, 6) [N, N m], world axes, at the bodies' centres of mass, for the next step()."""
        with self._lock:
            self._require_world()
            self._require(Capability.WRENCHES)
            write.push(self, wrench, bodies, self._ids(env_ids))

    # ------------------------------------------------------------------ parameters

    def get_parameters(self, name: str, env_ids: EnvIds = None, indices: Indices = None) -> Array:
        """Values (E, K, ...) of a neutral parameter such as `body.mass`, as the engine has them."""
        with self._lock:
            self._require_world()
            return write.read_parameter(self, name, env_ids, indices)

    def set_parameters(self, name: str, values: Any, env_ids: EnvIds = None, indices: Indices = None) -> None:
        """Change a neutral parameter per env, values (E, K, ...); what the engine took is read back and compared.

        Raises:
            CapabilityError: the engine cannot change it.
            EngineError: a wrong shape, a value out of bounds, or the engine kept another value.
        """
        with self._lock:
            self._require_world()
            write.write_parameter(self, name, values, env_ids, indices)

    def built_parameters(self, name: str) -> Array:
        """Values (K, ...) of a parameter that the World gives, whatever they are now."""
        with self._lock:
            self._require_world()
            return write.built_parameter(self, name)

    # ------------------------------------------------------------------ snapshots

    def snapshot(self, env_ids: EnvIds = None, level: SnapshotLevel | str = SnapshotLevel.TRAJECTORY) -> Snapshot:
        """Copy the state of envs, with their commands, camera poses, clocks and changed parameters."""
        with self._lock:
            self._require_world()
            level = SnapshotLevel(level)
            self._require(Capability(f"snapshot: {level}"))
            return take_snapshot(self, self._ids(env_ids), level)

    def restore(self, snapshot: Snapshot, env_ids: EnvIds = None) -> None:
        """Put snapshot rows into envs (as many as it holds, in order).

        Raises:
            SnapshotError: of another engine, engine version or world, or another number of rows; nothing was changed.
        """
        with self._lock:
            self._require_world()
            ids = self._ids(env_ids)
            arguments.same_stamp(snapshot, self.name, self.version, self.world.hash, len(ids))
            refuse_foreign(self, snapshot)
            put_back(self, ids, snapshot)

    def world_state(self, env_ids: EnvIds = None) -> WorldState:
        """Where everything is, by name, in a form for any engine; close and not exact, unlike a snapshot."""
        with self._lock:
            self._require_world()
            return world_state_io.read(self, self._ids(env_ids))

    def set_world_state(self, state: WorldState, env_ids: EnvIds = None, missing: Missing = "refuse") -> Carried:
        """Put envs into a state, from whatever engine and world, as if they had just been reset into it.

        Where names differ: `refuse`, or carry over what both have and `keep` the rest. Returns what differs.

        Raises:
            SnapshotError: names differ and that is refused, or another number of rows; nothing was changed.
        """
        with self._lock:
            self._require_world()
            return world_state_io.write(self, state, self._ids(env_ids), missing)

    # ------------------------------------------------------------------ sensing

    def render(
        self,
        camera_name: str = "default",
        width: int | None = None,
        height: int | None = None,
        env_ids: EnvIds = None,
        channels: Sequence[str] = ("rgb",),
    ) -> dict[str, Array]:
        """Images of one camera, by channel.

        `rgb` (E, H, W, 3) uint8; `depth` (E, H, W) float32 [m] along the optical axis, inf beyond the far plane;
        `segmentation` (E, H, W) int32 entity ids (`Index.segmentation_id`; 0 elsewhere).

        `default` is an overview of the world where no camera has that name.
        """
        with self._lock:
            self._require_world()
            for channel in channels:
                if channel not in ("rgb", "depth", "segmentation"):
                    raise EngineError(f"there is no channel '{channel}' (channels: rgb, depth, segmentation)")
                self._require(Capability(f"render: {channel}"))
            ids = self._ids(env_ids)
            view = self._rig.view(camera_name, self.index, self.get_state(), ids, width, height)
            return self._render(view, ids, tuple(channels))

    def camera_poses(self, camera_name: str, env_ids: EnvIds = None) -> Array:
        """World poses (E, 7) of a camera's optical frame now."""
        with self._lock:
            self._require_world()
            return self._rig.view(camera_name, self.index, self.get_state(), self._ids(env_ids), None, None).pose

    def set_camera_pose(self, camera_name: str, pose: Any, env_ids: EnvIds = None) -> None:
        """Place a camera per env: poses (E, 7) in the frame of its body, or of the world where it has none."""
        with self._lock:
            self._require_world()
            ids = self._ids(env_ids)
            self._rig.poses[ids, self.index.camera(camera_name)] = arguments.poses("pose", pose, (len(ids), 7))

    def camera_mounts(self, camera_name: str, env_ids: EnvIds = None) -> Array:
        """Poses (E, 7) of a camera's optical frame in the frame of its body, or of the world where it has none."""
        with self._lock:
            self._require_world()
            return self._rig.poses[self._ids(env_ids), self.index.camera(camera_name)]

    def camera_fov(self, camera_name: str, env_ids: EnvIds = None) -> Array:
        """Vertical fields of view (E,) [degrees] of a camera."""
        with self._lock:
            self._require_world()
            return self._rig.fov[self._ids(env_ids), self.index.camera(camera_name)]

    def set_camera_fov(self, camera_name: str, fov: Any, env_ids: EnvIds = None) -> None:
        """Change a camera's vertical field of view per env: (E,) [degrees], between 1 and 170."""
        with self._lock:
            self._require_world()
            ids = self._ids(env_ids)
            rows = arguments.rows("fov", fov, (len(ids),))
            if rows.size and not (rows.min() > 1 and rows.max() < 170):
                raise EngineError(
                    f"a field of view lies between 1 and 170 degrees, got {rows.min():g} to {rows.max():g}"
                )
            self._rig.fov[ids, self.index.camera(camera_name)] = rows

    def raycast(self, origins: Any, directions: Any, env_ids: EnvIds = None) -> RayHits:
        """First hits of rays (E, R, 3) [m], world frame, with collision geometry. Directions need not be unit."""
        with self._lock:
            self._require_world()
            self._require(Capability.RAYCAST)
            ids = self._ids(env_ids)
            start = arguments.rows("origins", origins, (len(ids), None, 3))
            along = arguments.rows("directions", directions, start.shape)
            length = np.linalg.norm(along, axis=-1, keepdims=True)
            if start.size and length.min() < 1e-12:
                raise EngineError("a ray needs a direction that is not zero")
            return self._raycast(start, along / length, ids)

    def contacts(self, env_ids: EnvIds = None) -> ContactPoints:
        """All contact points of envs in their current state."""
        with self._lock:
            self._require_world()
            self._require(Capability.CONTACT_POINTS)
            return self._contacts(self._ids(env_ids))

    # ------------------------------------------------------------------ live editing

    def add_robot(self, name: str, robot: str, **placement: Any) -> None:
        """Add a robot of the catalogue to every env: `add_robot("left", "franka_panda", position=(0, 0.4, 0))`."""
        from anysim.compile.edit import with_robot

        with self._lock:
            self._rebuild(with_robot(self.world, name, robot, placement))

    def add_object(self, name: str, source: Any, **spec: Any) -> None:
        """Add an object to every env: `add_object("ball", {"sphere": 0.03}, mass=0.1, position=(0.5, 0, 0.5))`."""
        from anysim.compile.edit import with_object

        with self._lock:
            self._rebuild(with_object(self.world, name, {"source": source, **spec}))

    def remove_robot(self, name: str) -> None:
        """Remove a robot; the rest goes on as it was."""
        from anysim.compile.edit import without_entity

        with self._lock:
            self.index.robot(name)
            self._rebuild(without_entity(self.world, name))

    def remove_object(self, name: str) -> None:
        """Remove an object; the rest goes on as it was."""
        from anysim.compile.edit import without_entity

        with self._lock:
            if name not in [e.name for e in self.index.objects]:
                raise EngineError(
                    f"there is no object '{name}' (objects: {listing(e.name for e in self.index.objects)})"
                )
            self._rebuild(without_entity(self.world, name))

    def add_camera(self, name: str, **spec: Any) -> None:
        """Add a camera, with the fields of a world's `cameras` entry."""
        from anysim.compile.edit import with_camera

        with self._lock:
            world = with_camera(self.world, name, spec)
            self._rig = self._rig.extended(world)
            self._world = world
            self.index = Index(world)

    def _rebuild(self, world: World) -> None:
        """Replace the world, carrying by name all that both worlds have. On failure the old world is untouched."""
        from anysim.engine.rebuild import carry_over

        needs = self._check(world)
        carry_over(self, world)
        self.approximations = needs

    # ------------------------------------------------------------------ the simple named surface

    def list_robots(self) -> list[str]:
        """The names of the robots."""
        return [robot.name for robot in self.world.robots]

    def robot_joint_names(self, robot_name: str | None = None) -> list[str]:
        """The names of a robot's joints, without its own name in front."""
        prefix = len(self.index.robot(robot_name).name) + 1
        return [self.world.joints[j].name[prefix:] for j in self.index.robot_joints(robot_name)]

    def get_observation(self, robot_name: str | None = None, *, skip_images: bool = False) -> dict[str, Array]:
        """What a script or agent wants to know about a robot.

        `joint_pos`, `joint_vel` (N, J), `<tool>_pose` (N, 7), and `images/<camera>` of all cameras unless skipped.
        """
        from anysim.engine.named_access import observation

        with self._lock:
            return observation(self, robot_name, skip_images)

    def send_action(
        self, action: Mapping[str, float] | Any, robot_name: str | None = None, n_substeps: int = 1
    ) -> None:
        """Set position targets (by joint name, or (N, A) for all of the robot's drives) and step."""
        from anysim.engine.named_access import send

        with self._lock:
            send(self, action, robot_name)
            self.step(n_substeps)

    # ------------------------------------------------------------------ helpers

    def _require_world(self) -> None:
        if self._world is None:
            state = "was destroyed" if self._destroyed else "has no world; call create_world() first"
            raise EngineError(f"this {self.name} engine {state}")

    def _require(self, capability: Capability) -> None:
        if capability not in self.capabilities:
            raise CapabilityError(
                f"{self.name} does not have '{capability}' (`anysim list engines` shows what each can do)"
            )

    def _ids(self, env_ids: EnvIds) -> Array:
        return self._all if env_ids is None else arguments.indices(env_ids, self.num_envs, "env")

    def _which(self, indices: Indices, size: int, kind: str) -> Array:
        return np.arange(size) if indices is None else arguments.indices(indices, size, kind)

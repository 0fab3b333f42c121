"""SimEngine: the one interface of all physics engines.

The public methods here check, lock, cache and account; a backend writes the primitives of
`anysim.engine.primitives` (names with a leading underscore). `num_envs` copies of one World are stepped together, each
with its own state. Building, stepping and states are in `anysim.engine.lifecycle`, images and rays in
`anysim.engine.sensing`.
"""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from anysim.conventions import Array
from anysim.engine import arguments
from anysim.engine.capability import Capability
from anysim.engine.control import Control
from anysim.engine.lifecycle import EnvIds, Indices
from anysim.engine.parameters import APPEARANCE, PARAMETERS, Parameter, check_values, count
from anysim.engine.presence import write_present
from anysim.engine.records import below
from anysim.engine.sensing import EngineSensing
from anysim.engine.snapshots.row_checks import damaged, mapping_of_arrays, refuse_other_forms, refuse_parameters
from anysim.engine.snapshots.world_state import (
    Missing,
    WorldState,
    WorldStateGaps,
    read_world_state,
    refuse_world_state,
    write_world_state,
)
from anysim.engine.state import Snapshot, SnapshotLevel
from anysim.errors import AnysimError, CapabilityError, EngineError, listing, suggest
from anysim.math import pose as P
from anysim.model.index import Index
from anysim.model.world import BodyKind, ControlMode

__all__ = ["EnvIds", "Indices", "SimEngine"]


class SimEngine(EngineSensing):
    """A physics engine that holds `num_envs` sub-environments of one World."""

    # ------------------------------------------------------------------ writing

    def set_joint_state(
        self,
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        env_ids: EnvIds = None,
        joints: Indices = None,
    ) -> None:
        """Write joint positions and velocities (E, K); mimic joints follow their leaders. Commands stay."""
        with self._lock:
            self._require_world()
            ids, which = self._ids(env_ids), self._which(joints, len(self.world.joints), "joint")
            shape = (len(ids), len(which))
            pos = None if position is None else arguments.rows("position", position, shape)
            vel = None if velocity is None else arguments.rows("velocity", velocity, shape)
            which, pos, vel = arguments.with_followers(self.world, which, pos, vel)
            self._retire_state()
            write_present(self._write_joints, self._presence.joints, ids, which, pos, vel)

    def set_body_state(
        self,
        pose: ArrayLike | None = None,
        twist: ArrayLike | None = None,
        env_ids: EnvIds = None,
        bodies: Indices = None,
    ) -> None:
        """Write poses (E, K, 7) and twists (E, K, 6) of root bodies: free ones, and poses of static ones.

        `bodies` defaults to all free bodies. Links move by their joints: naming one is an error.
        """
        with self._lock:
            self._require_world()
            ids, all_bodies = self._ids(env_ids), self.world.bodies
            if bodies is None:
                bodies = [i for i, body in enumerate(all_bodies) if body.kind is BodyKind.FREE]
            which = self._which(bodies, len(all_bodies), "body")
            poses = None if pose is None else arguments.poses("pose", pose, (len(ids), len(which), 7))
            twists = None if twist is None else arguments.rows("twist", twist, (len(ids), len(which), 6))
            arguments.roots_only(self.world, which, with_twist=twists is not None)
            self._retire_state()
            write_present(self._write_bodies, self._presence.bodies, ids, which, poses, twists)

    def set_control(
        self,
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        effort: ArrayLike | None = None,
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

    def apply_wrench(self, wrench: ArrayLike, bodies: Indices, env_ids: EnvIds = None, *, once: bool = False) -> None:
        """Forces and torques (E, K, 6) [N, N m], world axes, at the bodies' centres of mass, for the next step().

        With `once` they are not kept where that keeps wrenches for the one after it.
        """
        with self._lock:
            self._require_world()
            self._require(Capability.WRENCHES)
            ids, which = self._ids(env_ids), self._which(bodies, len(self.world.bodies), "body")
            forces = arguments.rows("wrench", wrench, (len(ids), len(which), 6))
            if self._presence.varies:
                forces = np.where(self._presence.bodies[ids[:, None], which, None], forces, 0.0)
            self._commands.add_wrench(forces, ids, which, once=once)

    # ------------------------------------------------------------------ parameters

    def get_parameters(self, name: str, env_ids: EnvIds = None, indices: Indices = None) -> Array:
        """Values (E, K, ...) of a neutral parameter such as `body.mass`, as the engine has them."""
        with self._lock:
            self._require_world()
            _, ids, which = self._chosen(name, env_ids, indices)
            return self._get_parameter(name)[ids[:, None], which].copy()

    def set_parameters(self, name: str, values: ArrayLike, env_ids: EnvIds = None, indices: Indices = None) -> None:
        """Change a neutral parameter per env, values (E, K, ...); what the engine took is read back and compared.

        Raises:
            CapabilityError: the engine cannot change it.
            EngineError: a wrong shape, a value out of bounds, or the engine kept another value.
        """
        with self._lock:
            self._require_world()
            parameter, ids, which = self._chosen(name, env_ids, indices)
            rows = arguments.rows(name, values, (len(ids), len(which), *parameter.shape))
            check_values(parameter, self.world, rows, which)
            self._retire_state()
            self._set_parameter(name, rows, ids, which)
            self._records.changed[name] = None
            if name in APPEARANCE:
                self._records.appearance[ids] += 1
            arguments.kept(self.name, name, rows, self._get_parameter(name)[ids[:, None], which])
            if name in ("actuator.kp", "actuator.kd"):
                self._commands.control_changed = True

    def built_parameters(self, name: str) -> Array:
        """Values (K, ...) of a parameter that the World gives, whatever they are now."""
        with self._lock:
            self._require_world()
            self._chosen(name, None, None)
            return self._default_parameter(name).copy()

    def _chosen(self, name: str, env_ids: EnvIds, indices: Indices) -> tuple[Parameter, Array, Array]:
        parameter = PARAMETERS.get(arguments.named("parameter", name))
        if parameter is None:
            raise EngineError(f"there is no parameter '{name}' (parameters: {listing(PARAMETERS, 20)})")
        if name not in self.parameters:
            raise CapabilityError(
                f"{self.name} cannot change '{name}' (it can: {listing(sorted(self.parameters), 20)})"
            )
        which = self._which(indices, count(parameter, self.world), parameter.target)
        return parameter, self._ids(env_ids), which

    # ------------------------------------------------------------------ snapshots

    def snapshot(self, env_ids: EnvIds = None, level: SnapshotLevel | str = SnapshotLevel.TRAJECTORY) -> Snapshot:
        """Copy the state of envs, with their commands, camera poses, clocks and changed parameters."""
        with self._lock:
            self._require_world()
            level, ids = SnapshotLevel(level), self._ids(env_ids)
            self._require(Capability(f"snapshot: {level}"))
            data = self._records.snapshot(ids)
            data |= {f"parameter.{name}": self._get_parameter(name)[ids] for name in self._records.changed}
            data |= {f"engine.{name}": rows for name, rows in self._snapshot(ids, level).items()}
            copies = {name: np.array(rows) for name, rows in data.items()}
            return Snapshot(self.name, self.version, self.world.hash, level, copies)

    def restore(self, snapshot: Snapshot, env_ids: EnvIds = None, *, checked: bool = False) -> None:
        """Put snapshot rows into envs (as many as it holds, in order); `checked` by `refuse_snapshot` just before.

        A parameter that was changed since, but not when the snapshot was taken, gets its built value back.

        Raises:
            SnapshotError: of another engine, engine version or world, another number of rows, or damaged.

        Whatever is raised, nothing was changed; only an env that was given up before is as it is then.
        """
        with self._lock:
            self._require_world()
            ids = self._ids(env_ids)
            if not checked:
                self.refuse_snapshot(snapshot, ids)
            with self._or_as_before(ids):
                self._put(snapshot, ids)

    def refuse_snapshot(self, snapshot: Snapshot, env_ids: EnvIds = None) -> None:
        """Refuse a snapshot that cannot be put into these envs, as `restore` does before it changes anything.

        Every array is looked at: its name, type and shape, whether it is finite, and the range of its values.

        Raises:
            SnapshotError: of another engine, engine version or world, another number of rows, or damaged.
        """
        with self._lock:
            self._require_world()
            ids, level = self._ids(env_ids), snapshot.level
            data = mapping_of_arrays("the engine's state", snapshot.data)
            arguments.same_stamp(snapshot, self.name, self.version, self.world.hash, len(ids))
            self._require(Capability(f"snapshot: {level}"))
            own, values = below("engine.", data), below("parameter.", data)
            rest = {name: rows for name, rows in data.items() if not name.startswith(("engine.", "parameter."))}
            self._records.refuse_foreign(rest, ids)
            refuse_parameters(self.world, self.parameters, values, len(ids))
            if level not in self._row_forms:
                forms = self._snapshot(self._all[:1], level)
                self._row_forms[level] = {name: np.empty_like(rows) for name, rows in forms.items()}
            like, fault = self._row_forms[level], own.get("fault")
            faulty = fault if fault is not None and fault.shape == ids.shape and fault.dtype == bool else None
            refuse_other_forms(self.name, own, like, len(ids), ragged=self.ragged_rows, faulty=faulty)
            self.refuse_rows(own, level, self.world, self.options)

    @contextmanager
    def _or_as_before(self, ids: Array) -> Generator[None, None, None]:
        """Write all of a state that was read somewhere, or none of it: an engine may refuse what passed every check."""
        levels = [s for s in reversed(SnapshotLevel) if Capability(f"snapshot: {s}") in self.capabilities]
        sound = ids[~self.get_state().fault[ids]]
        before = self.snapshot(sound, levels[0]) if len(sound) and levels else None
        try:
            yield
        except BaseException as error:
            if before is not None:
                self._put(before, sound)
            if isinstance(error, AnysimError) or not isinstance(error, Exception):
                raise
            raise damaged(f"{self.name} cannot read it ({type(error).__name__}: {error})") from error

    def _put(self, snapshot: Snapshot, ids: Array) -> None:
        """Write the rows of a snapshot that was checked."""
        with self._lock:
            data = snapshot.data
            self._retire_state()
            if "present" in data:  # first, with parameters, since an engine's state depends on them
                self._reset(self._admit(ids, data["present"]))
            for name in PARAMETERS:
                rows = data.get(f"parameter.{name}")
                if rows is None and name in self._records.changed:
                    rows = np.repeat(self._default_parameter(name)[None], len(ids), axis=0)
                if rows is not None:
                    self._set_parameter(name, rows, ids, np.arange(int(rows.shape[1])))
                    self._records.changed[name] = None
            self._records.restore(ids, data)
            self._restore(ids, below("engine.", data), snapshot.level)

    def world_state(self, env_ids: EnvIds = None) -> WorldState:
        """Where everything is, by name, in a form for any engine; close and not exact, unlike a snapshot."""
        with self._lock:
            self._require_world()
            return read_world_state(self, self._records, self._ids(env_ids))

    def set_world_state(self, state: WorldState, env_ids: EnvIds = None, missing: Missing = "refuse") -> WorldStateGaps:
        """Put envs into a state, from whatever engine and world, as if they had just been reset into it.

        Where names differ: `refuse`, or carry over what both have and `keep` the rest. Returns what differs.

        Raises:
            SnapshotError: names differ and that is refused, or another number of rows; nothing was changed.
        """
        with self._lock:
            self._require_world()
            ids = self._ids(env_ids)
            carried = refuse_world_state(self, self._records, state, ids, missing)
            with self._or_as_before(ids):
                write_world_state(self, self._records, state, ids)
            self._retire_state()
            return carried

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
            self._records.add_cameras(world)
            self._world = world
            self.index = Index(world)

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
        with self._lock:
            robot = self.index.robot(robot_name)
            joints = list(self.index.robot_joints(robot.name))
            state = self.get_state()
            result: dict[str, Array] = {
                "joint_pos": state.joint_pos[:, joints],
                "joint_vel": state.joint_vel[:, joints],
                "base_pose": state.body_pose[:, self.index.entity(robot.name).root].copy(),
            }
            for tool in robot.tools:
                frame = self.index.frame(f"{robot.name}.{tool}")
                local = np.array([*frame.position, *frame.quaternion])
                result[f"{tool}_pose"] = P.compose(state.body_pose[:, frame.body], local[None])
            if not skip_images:
                for camera in self.world.cameras:
                    result[f"images/{camera.name}"] = self.render(camera.name)["rgb"]
            return result

    def send_action(
        self, action: Mapping[str, float] | Any, robot_name: str | None = None, n_substeps: int = 1
    ) -> None:
        """Set position targets (by joint name, or (N, A) for all of the robot's drives) and step."""
        with self._lock:
            self._send(action, robot_name)
            self.step(n_substeps)

    def _send(self, action: Mapping[str, float] | Array, robot_name: str | None) -> None:
        robot = self.index.robot(robot_name)
        joints = self.index.robot_joints(robot.name)
        drives = [i for i, a in enumerate(self.world.actuators) if a.joint in joints]
        names = [self.world.joints[self.world.actuators[i].joint].name[len(robot.name) + 1 :] for i in drives]
        if not isinstance(action, Mapping):
            self.set_control(position=action, actuators=drives)
            return
        unknown = [name for name in action if name not in names]
        if unknown:
            raise EngineError(
                f"robot '{robot.name}' has no driven joint '{unknown[0]}'{suggest(unknown[0], names)} "
                f"(joints: {listing(names)})"
            )
        chosen = [drives[names.index(name)] for name in action]
        columns = [arguments.rows(f"the action of '{name}'", v, (self.num_envs,)) for name, v in action.items()]
        self.set_control(position=np.array(columns).T.reshape(self.num_envs, len(chosen)), actuators=chosen)

"""The backends themselves: strands-robots' `SimEngine` on MuJoCo, PyBullet and SAPIEN through anysim."""

import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from strands_robots.rendering.camera import CameraParams  # pyright: ignore[reportMissingImports]
from strands_robots.simulation.base import SimEngine  # pyright: ignore[reportMissingImports]

from anysim.conventions import Array
from anysim.errors import AnysimError, CapabilityError, EngineError, NameLookupError, listing
from anysim.math import pose as P
from anysim.math.arrays import shown, whole
from anysim_adapters.strands.answers import Answer, answering, error, success
from anysim_adapters.strands.randomize import Ranges, randomize
from anysim_adapters.strands.things import finite, keyframe_fields, object_fields, place, robot_model, vector
from anysim_adapters.strands.world import WorldView

NO_WORLD = "there is no world; call create_world or load_scene first"


class AnysimSimulation(SimEngine):
    """A world of anysim with one env. Each call answers as an agent's tool; what goes wrong is said in words."""

    ENGINE: ClassVar[str] = ""

    def __init__(self, timestep: float | None = None, tool_name: str = "simulation", **options: Any) -> None:
        if options:
            raise TypeError(f"{type(self).__name__} takes timestep and tool_name, got {listing(options)}")
        self.tool_name_str = tool_name
        self._lock = threading.RLock()
        self._timestep = timestep
        self._view: WorldView | None = None
        self._models: dict[str, str] = {}
        self._rng = np.random.default_rng(0)
        self._init_complete = True

    @property
    def _open(self) -> WorldView:
        if self._view is None:
            raise EngineError(NO_WORLD)
        return self._view

    # ------------------------------------------------------------------ the world

    @answering
    def create_world(
        self,
        timestep: float | None = None,
        gravity: list[float] | None = None,
        ground_plane: bool = True,
        terrain: str | None = None,
        difficulty: float = 1.0,
    ) -> Answer:
        """An empty world, in place of the present one."""
        if terrain is not None or difficulty != 1.0:
            raise EngineError("terrain cannot be given here; load_scene takes a world file with any `terrain`")
        physics: dict[str, Any] = {}
        step = self._timestep if timestep is None else timestep
        if step is not None:
            found = finite("timestep", step)
            if found.shape != () or isinstance(step, bool) or found <= 0:
                raise EngineError(f"timestep is a time greater than 0 [s], got {shown(step)}")
            physics["dt"] = float(found)
            physics["control_dt"] = float(found)
        if gravity is not None:
            scalar = np.ndim(gravity) == 0
            physics["gravity"] = vector("gravity", [0.0, 0.0, gravity] if scalar else gravity, 3)
        source = {"world": {"terrain": "plane" if ground_plane else "none"}, "physics": physics}
        return self._begin(source, "a world")

    @answering
    def load_scene(self, scene_path: str) -> Answer:
        """The world of an anysim YAML file, or of an installed task by name, in place of the present one."""
        if Path(scene_path).suffix.lower() in (".xml", ".urdf", ".mjb", ".usd"):
            raise EngineError(
                f"{scene_path}: a scene is the YAML file of a world or an installed task; robots of URDF and MJCF "
                "files come by add_robot(urdf_path=…)"
            )
        return self._begin(scene_path, f"the scene {scene_path}")

    def _begin(self, source: Any, words: str) -> Answer:
        with self._lock:
            fresh = WorldView(self.ENGINE, source)
            self._end()
            self._view = fresh
            self._models = {robot.name: robot.model for robot in fresh.engine.world.robots}
            dt = fresh.engine.world.physics.dt
            return success(f"{words} on {self.ENGINE} by anysim, in steps of {dt:g} s", {"timestep": dt})

    def _end(self) -> None:
        if self._view is not None:
            self._view.engine.destroy()
            self._view, self._models = None, {}

    @answering
    def destroy(self) -> Answer:
        with self._lock:
            self._end()
        return success("the world is gone")

    def cleanup(self) -> None:
        self.destroy()

    @answering
    def reset(self) -> Answer:
        """All robots and objects where they were added, at rest, with targets that hold them there."""
        with self._lock:
            self._open.engine.reset()
        return success("reset")

    @answering
    def step(self, n_steps: int = 1) -> Answer:
        left = total = whole("n_steps", n_steps, EngineError)
        while left:
            with self._lock:
                part = min(left, self._STEPS_PER_BATCH)
                self._open.engine.step(part)
                left -= part
        return success(f"{total} steps")

    @answering
    def get_state(self) -> Answer:
        with self._lock:
            view = self._open
            state = view.engine.get_state()
            world = view.engine.world
            found = {
                "sim_time": float(state.time[0]),
                "timestep": world.physics.dt,
                "gravity": [float(g) for g in view.engine.get_parameters("world.gravity")[0].reshape(-1)],
                "robots": {r.name: {"model": r.model, "joints": list(view.joints(r.name))} for r in world.robots},
                "objects": {e.name: view.body_state(e.name) for e in view.engine.index.objects},
                "cameras": view.cameras(),
            }
        return success(f"t = {found['sim_time']:.3f} s; robots: {listing(found['robots'])}", found)

    @property
    def _sim_time(self) -> float | None:
        return None if self._view is None else float(self._view.engine.get_state().time[0])

    def physics_timestep(self) -> float | None:
        return None if self._view is None else self._view.engine.world.physics.dt

    # ------------------------------------------------------------------ robots

    @answering
    def add_robot(
        self,
        name: str,
        urdf_path: str | None = None,
        data_config: str | None = None,
        position: list[float] | None = None,
        orientation: list[float] | None = None,
        keyframe: str | int | None = None,
    ) -> Answer:
        """A robot of the catalogue, or of a URDF or MJCF file or the YAML entry of one. It begins at home."""
        with self._lock:
            model = robot_model(name, urdf_path, data_config)
            fields = place(position, orientation) | keyframe_fields(keyframe, urdf_path)
            self._open.engine.add_robot(name, model, **fields)
            self._models[name] = data_config or name
        return success(f"robot '{name}' with {len(self._open.joints(name))} joints", {"robot": name, "model": model})

    @answering
    def remove_robot(self, name: str) -> Answer:
        with self._lock:
            self._open.engine.remove_robot(name)
            self._models.pop(name, None)
        return success(f"robot '{name}' is gone")

    def list_robots(self) -> list[str]:
        return [] if self._view is None else self._view.engine.list_robots()

    def robot_joint_names(self, robot_name: str) -> list[str]:
        if robot_name not in self.list_robots():
            raise ValueError(self._unknown_robot_msg(robot_name))
        return list(self._open.joints(robot_name))

    def robot_action_keys(self, robot_name: str) -> list[str]:
        """The driven joints, in the order of the joints."""
        driven = self._open.drives(robot_name) if robot_name in self.list_robots() else {}
        return [joint for joint in self.robot_joint_names(robot_name) if joint in driven]

    def actuator_ranges(self, robot_name: str) -> dict[str, tuple[float, float]]:
        self.robot_joint_names(robot_name)
        return self._open.ranges(robot_name)

    @answering
    def get_robot_state(self, robot_name: str) -> Answer:
        with self._lock:
            joints = self._open.joint_state(self._open.robot(robot_name).name)
            state: dict[str, Any] = {n: {"position": q, "velocity": v} for n, (q, v) in joints.items()}
            base = self._open.base(robot_name)
        if base is not None:
            state["base"] = base
        return success(f"robot '{robot_name}' with {len(joints)} joints", {"state": state})

    # ------------------------------------------------------------------ objects

    @answering
    def add_object(
        self,
        name: str,
        shape: str = "box",
        position: list[float] | None = None,
        orientation: list[float] | None = None,
        size: list[float] | None = None,
        color: list[float] | None = None,
        mass: float = 0.1,
        is_static: bool | None = None,
        mesh_path: str | None = None,
        material: dict[str, Any] | None = None,
    ) -> Answer:
        """A primitive or a mesh. Sizes are full extents [m]."""
        fields = object_fields(shape, size, color, mass, is_static, mesh_path, material)
        source = fields.pop("source")
        with self._lock:
            self._open.engine.add_object(name, source, **fields, **place(position, orientation))
        return success(f"object '{name}': {shape}")

    @answering
    def remove_object(self, name: str) -> Answer:
        with self._lock:
            self._open.engine.remove_object(name)
        return success(f"object '{name}' is gone")

    @answering
    def move_object(
        self, name: str, position: list[float] | None = None, orientation: list[float] | None = None
    ) -> Answer:
        """Put an object elsewhere, at rest."""
        with self._lock:
            known = [entity.name for entity in self._open.engine.index.objects]
            if name not in known:
                raise NameLookupError(f"there is no object '{name}' (objects: {listing(known)})")
            found = place(position, orientation)
            self._open.place(name, found.get("position"), found.get("quaternion"))
        return success(f"object '{name}' moved")

    @answering
    def list_objects(self) -> Answer:
        with self._lock:
            found = {e.name: self._open.body_state(e.name) for e in self._open.engine.index.objects}
        return success(f"objects: {listing(found)}", {"objects": found})

    @answering
    def list_bodies(self, robot_name: str | None = None) -> Answer:
        with self._lock:
            chosen = [b for b in self._open.labels() if robot_name is None or b.partition("/")[0] == robot_name]
        return success(f"bodies: {listing(chosen, 40)}", {"bodies": chosen})

    @answering
    def get_body_state(self, body_name: str) -> Answer:
        with self._lock:
            found = self._open.body_state(body_name)
        return success(f"'{body_name}' at {found['position']}", found)

    @answering
    def get_contacts(self) -> Answer:
        with self._lock:
            found = self._open.contacts()
        return success(f"{len(found)} contacts", {"contacts": found})

    def _ground_height_at(self, x: float, y: float) -> float:
        return 0.0 if self._view is None else float(self._view.engine.world.ground.heights_at(np.array([[x, y]]))[0])

    # ------------------------------------------------------------------ observations and actions

    def get_observation(self, robot_name: str | None = None, *, skip_images: bool = False) -> dict[str, Any]:
        """`joint`, `joint.vel`, the pose and twist of a floating base, and an image of each camera under its name.

        A camera that cannot be drawn here is left out; with no world or no such robot there is nothing.
        """
        robots = self.list_robots()
        name = robots[0] if robot_name is None and len(robots) == 1 else robot_name
        if self._view is None or name not in robots:
            return {}
        with self._lock:
            view = self._open
            seen: dict[str, Any] = {}
            for joint, (position, velocity) in view.joint_state(name).items():
                seen[joint], seen[f"{joint}.vel"] = position, velocity
            seen |= view.base(name) or {}
            for camera in [] if skip_images else view.cameras():
                try:
                    seen[camera] = view.picture(camera, None, None)
                except CapabilityError:
                    continue
            return seen

    @answering
    def send_action(
        self, action: dict[str, Any] | Sequence[float], robot_name: str | None = None, n_substeps: int = 1
    ) -> Answer:
        """Give a robot's drives targets by joint, or all of them in the order of `robot_action_keys`, and step."""
        steps = whole("n_substeps", n_substeps, EngineError, least=1)
        with self._lock:
            view = self._open
            try:
                name = self._resolve_single_robot(robot_name)
            except ValueError as unclear:
                raise EngineError(str(unclear)) from None
            if name not in self.list_robots():
                raise NameLookupError(self._unknown_robot_msg(name))
            targets, refused = self._coerce_action(action, name)
            if refused is not None or targets is None:
                return refused or error("send_action: no action")
            drives = view.drives(name)
            unknown = [key for key in targets if key not in drives]
            if unknown:
                return error(
                    f"send_action: '{name}' has no driven joint {listing(unknown)} (joints: {listing(drives, 40)}); "
                    "nothing was applied",
                    {"unresolved_keys": unknown, "applied": {}},
                )
            values = {key: float(np.asarray(value).reshape(-1)[0]) for key, value in targets.items()}
            view.command(name, values)
            view.engine.step(steps)
        return success(f"applied to {len(values)} joints, {steps} steps", {"applied": values})

    # ------------------------------------------------------------------ cameras

    @answering
    def add_camera(
        self,
        name: str,
        position: list[float] | None = None,
        target: list[float] | None = None,
        fov: float = 60.0,
        width: int = 640,
        height: int = 480,
        parent_body: str | None = None,
    ) -> Answer:
        """A camera that looks at a target, both in the world's frame; with a parent in that body's, to ride on."""
        eye = vector("position", [1.0, 1.0, 1.0] if position is None else position, 3)
        aim = vector("target", [0.0, 0.0, 0.0] if target is None else target, 3)
        with self._lock:
            view = self._open
            seen = {"fov": float(fov), "size": [width, height], "channels": ["rgb", "depth"]}
            if parent_body is None:
                view.engine.add_camera(name, **{"from": eye, "look_at": aim}, **seen)
            else:
                turn = P.to_roll_pitch_yaw(P.look_at(np.array(eye), np.array(aim))).tolist()
                mount = view.reference(parent_body)
                view.engine.add_camera(name, mount=mount, position=eye, roll_pitch_yaw=turn, **seen)
        return success(f"camera '{name}', {width} by {height}")

    def list_cameras(self) -> list[str]:
        return [] if self._view is None else self._view.cameras()

    @answering
    def render(self, camera_name: str = "default", width: int | None = None, height: int | None = None) -> Answer:
        with self._lock:
            image = self._open.picture(camera_name, width, height)
        return success(f"camera '{camera_name}', {image.shape[1]} by {image.shape[0]}", image=image)

    def get_frame(
        self, camera_name: str = "default", width: int | None = None, height: int | None = None
    ) -> tuple[Array, Array | None]:
        """Colours (H, W, 3) uint8 and depths (H, W) float32 [m] along the optical axis, inf where nothing is."""
        with self._lock:
            return self._asked(lambda view: view.frame(camera_name, width, height))

    def get_camera_params(
        self, camera_name: str = "default", width: int | None = None, height: int | None = None
    ) -> Any:
        """Lens and pose of a camera as strands-robots' `CameraParams`."""
        with self._lock:
            return CameraParams(**self._asked(lambda view: view.lens(camera_name, width, height)))

    def _asked(self, ask: Any) -> Any:
        """An answer in Python's own errors, as the contract of frames has it."""
        try:
            return ask(self._open)
        except NameLookupError as missing:
            raise KeyError(str(missing)) from missing
        except CapabilityError as absent:
            raise NotImplementedError(str(absent)) from absent
        except AnysimError as failed:
            raise RuntimeError(str(failed)) from failed

    # ------------------------------------------------------------------ randomization

    @answering
    def randomize(
        self,
        randomize_colors: bool = True,
        randomize_lighting: bool = True,
        randomize_physics: bool = False,
        randomize_positions: bool = False,
        position_noise: float = 0.02,
        color_range: tuple[float, float] = (0.1, 1.0),
        friction_range: tuple[float, float] = (0.5, 1.5),
        mass_range: tuple[float, float] = (0.5, 2.0),
        seed: int | None = None,
        **unknown: Any,
    ) -> Answer:
        """Draw colours, light, friction, masses and places of objects anew, about what the world was built with.

        Without a seed the draws go on from those before; a backend begins with seed 0.
        """
        if unknown:
            raise EngineError(f"there is nothing to randomize called {listing(unknown)}")
        if seed is not None:
            self._rng = np.random.default_rng(whole("seed", seed, EngineError))
        ranges = Ranges(
            randomize_colors,
            randomize_lighting,
            randomize_physics,
            randomize_positions,
            position_noise,
            color_range,
            friction_range,
            mass_range,
        )
        with self._lock:
            done = randomize(self._open.engine, ranges, self._rng)
        return success(f"randomized: {listing(done) or 'nothing'}", {"randomized": done})


class Mujoco(AnysimSimulation):
    """MuJoCo by anysim."""

    ENGINE = "mujoco"


class Pybullet(AnysimSimulation):
    """PyBullet by anysim."""

    ENGINE = "pybullet"


class Sapien(AnysimSimulation):
    """SAPIEN by anysim."""

    ENGINE = "sapien"

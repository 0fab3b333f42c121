"""The world behind a strands-robots backend: an engine with one env, its names, bodies and cameras."""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from anysim.api import compile_world
from anysim.conventions import WORLD, Array, wxyz_from_xyzw
from anysim.engine.base import SimEngine
from anysim.engine.factory import create_simulation
from anysim.errors import EngineError, NameLookupError, listing, suggest
from anysim.math import pose as P
from anysim.model.frames import find_frame
from anysim.model.world import BodyKind, ControlMode, Entity, Robot

GROUND_NAME = "ground"
"""What contacts call all that is fixed to the world."""
OPENGL_FROM_OPTICAL = np.diag([1.0, -1.0, -1.0, 1.0])


class WorldView:
    """One env of an engine under the names that strands-robots uses: joints and links without their robot's name."""

    def __init__(self, engine: str, source: Any) -> None:
        world = compile_world(source)
        self.engine: SimEngine = create_simulation(engine)
        try:
            self.engine.create_world(world, 1)
            self.engine.reset()
        except BaseException:
            self.engine.destroy()
            raise

    # ------------------------------------------------------------------ names

    def robot(self, name: str) -> Robot:
        return self.engine.index.robot(name)

    def _entity(self, name: str) -> Entity:
        return self.engine.index.entity(name)

    def joints(self, robot: str) -> dict[str, int]:
        """Indices of a robot's joints by name."""
        return {self._short(robot, j): j for j in self.engine.index.robot_joints(robot)}

    def drives(self, robot: str) -> dict[str, int]:
        """Indices of a robot's drives by the names of their joints."""
        own = set(self.engine.index.robot_joints(robot))
        return {self._short(robot, a.joint): i for i, a in enumerate(self.engine.world.actuators) if a.joint in own}

    def _short(self, robot: str, joint: int) -> str:
        return self.engine.world.joints[joint].name[len(robot) + 1 :]

    def labels(self) -> list[str]:
        """The names of all bodies: `cube`, and `panda/panda_hand` for links."""
        return [self.label(body) for body in range(len(self.engine.world.bodies))]

    def label(self, body: int) -> str:
        """The name of a body; that of the ground for the world's own."""
        return GROUND_NAME if body == WORLD else self.engine.world.bodies[body].name.replace(".", "/", 1)

    def reference(self, name: str) -> str:
        """The world's own name of an object, a robot (its base), `robot/link`, or a link's own name where one has it.

        Raises:
            NameLookupError: there is none, or several.
        """
        world = self.engine.world
        asked = name.replace("/", ".", 1)
        found: list[str] = []
        for reference in (asked, *(f"{robot.name}.{asked}" for robot in world.robots)):
            with suppress(NameLookupError):
                find_frame(world, reference)
                found.append(reference)
        if asked in found:
            return asked
        if len(found) != 1:
            several = f"several robots have a body '{name}'" if found else f"there is no body '{name}'"
            labels = self.labels()
            raise NameLookupError(f"{several}{suggest(name, labels)} (bodies: {listing(labels, 40)})")
        return found[0]

    # ------------------------------------------------------------------ state

    def joint_state(self, robot: str) -> dict[str, tuple[float, float]]:
        """Position and velocity of each joint."""
        state = self.engine.get_state()
        return {
            name: (float(state.joint_pos[0, j]), float(state.joint_vel[0, j])) for name, j in self.joints(robot).items()
        }

    def base(self, robot: str) -> dict[str, list[float]] | None:
        """Pose (wxyz) of a floating base, its linear velocity in world axes and its angular one in its own."""
        root = self._entity(robot).body_start
        if self.engine.world.bodies[root].kind is not BodyKind.FREE:
            return None
        state = self.engine.get_state()
        pose, twist = state.body_pose[0, root], state.body_twist[0, root]
        return {
            "base_pos": pose[:3].tolist(),
            "base_quat": wxyz_from_xyzw(pose[3:]).tolist(),
            "base_lin_vel": twist[:3].tolist(),
            "base_ang_vel": P.rotate_inverse(pose[3:], twist[3:]).tolist(),
        }

    def body_state(self, name: str) -> dict[str, Any]:
        """Pose and twist of a body or link, and mass and centre of mass of the body that it is or is fixed to."""
        frame, state = find_frame(self.engine.world, self.reference(name)), self.engine.get_state()
        body = frame.body
        carrier, twist = state.body_pose[0, body], state.body_twist[0, body]
        pose = P.compose(carrier, np.array([*frame.position, *frame.quaternion]))
        center = self.engine.get_parameters("body.com")[0, body]
        return {
            "body": self.label(body),
            "position": pose[:3].tolist(),
            "quaternion": wxyz_from_xyzw(pose[3:]).tolist(),
            "rotation_matrix": P.to_matrix(pose[3:]).tolist(),
            "linear_velocity": (twist[:3] + np.cross(twist[3:], pose[:3] - carrier[:3])).tolist(),
            "angular_velocity": twist[3:].tolist(),
            "mass": float(self.engine.get_parameters("body.mass")[0, body]),
            "center_of_mass": (carrier[:3] + P.rotate(carrier[3:], center)).tolist(),
        }

    def contacts(self) -> list[dict[str, Any]]:
        """All contact points; one that carries a force or penetrates is `active`."""
        found = self.engine.contacts()
        return [
            {
                "geom1": self.label(int(a)),
                "geom2": self.label(int(b)),
                "bodies1": self._path(int(a)),
                "bodies2": self._path(int(b)),
                "dist": -float(depth),
                "pos": position.tolist(),
                "force": force.tolist(),
                "active": bool(depth >= 0 or np.any(force)),
            }
            for a, b, position, force, depth in zip(
                found.body_a, found.body_b, found.position, found.force, found.depth, strict=True
            )
        ]

    def _path(self, body: int) -> list[str]:
        """A body and those that carry it, from itself to the root."""
        path: list[str] = []
        while body != WORLD:
            path.append(self.label(body))
            body = self.engine.world.bodies[body].parent
        return path

    # ------------------------------------------------------------------ commands

    def command(self, robot: str, targets: Mapping[str, float]) -> None:
        """Give drives their targets: positions, velocities or efforts, as each is driven. The others keep theirs."""
        drives = self.drives(robot)
        for mode in ControlMode:
            chosen = [n for n in targets if self.engine.world.actuators[drives[n]].mode is mode]
            if chosen:
                row = np.array([[targets[n] for n in chosen]])
                self.engine.set_control(**{mode.value: row}, actuators=[drives[n] for n in chosen])

    def ranges(self, robot: str) -> dict[str, tuple[float, float]]:
        """The range of each driven joint that is limited and driven by positions."""
        world = self.engine.world
        found: dict[str, tuple[float, float]] = {}
        for name, drive in self.drives(robot).items():
            joint = world.joints[world.actuators[drive].joint]
            if world.actuators[drive].mode is ControlMode.POSITION and np.isfinite([joint.lower, joint.upper]).all():
                found[name] = (joint.lower, joint.upper)
        return found

    def place(self, name: str, position: Any, orientation: Any) -> None:
        """Put an entity's root at a position and an orientation (xyzw), where they are given; at rest if it is free."""
        root = self._entity(name).body_start
        pose = self.engine.get_state().body_pose[:, [root]].copy()
        if position is not None:
            pose[0, 0, :3] = position
        if orientation is not None:
            pose[0, 0, 3:] = orientation
        free = self.engine.world.bodies[root].kind is BodyKind.FREE
        self.engine.set_body_state(pose, np.zeros((1, 1, 6)) if free else None, bodies=[root])

    # ------------------------------------------------------------------ cameras

    def cameras(self) -> list[str]:
        return [camera.name for camera in self.engine.world.cameras]

    def frame(self, camera: str, width: int | None, height: int | None) -> tuple[Array, Array]:
        """Colours (H, W, 3) uint8 and depths (H, W) float32 [m] along the optical axis, inf where nothing is."""
        self._known(camera)
        images = self.engine.render(camera, width, height, channels=("rgb", "depth"))
        return images["rgb"][0], images["depth"][0]

    def picture(self, camera: str, width: int | None, height: int | None) -> Array:
        """Colours (H, W, 3) uint8."""
        self._known(camera)
        return self.engine.render(camera, width, height)["rgb"][0]

    def _known(self, camera: str) -> None:
        if camera != "default" and camera not in self.cameras():
            raise NameLookupError(
                f"there is no camera '{camera}'{suggest(camera, self.cameras())} (cameras: {listing(self.cameras())}, "
                "and `default`, an overview)"
            )

    def lens(self, camera: str, width: int | None, height: int | None) -> dict[str, Any]:
        """Intrinsic matrix `K` (3, 3) [px], pose `T_world_cam` (4, 4) of x right, y up, z backward, size, planes."""
        self._known(camera)
        view = self.engine.camera_view(camera)
        columns, rows = width or view.width, height or view.height
        if columns < 1 or rows < 1:
            raise EngineError(f"an image has at least one pixel, got {columns} by {rows}")
        focal = rows / 2 / np.tan(np.radians(view.fov[0]) / 2)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = P.to_matrix(view.pose[0, 3:]), view.pose[0, :3]
        return {
            "K": np.array([[focal, 0.0, columns / 2], [0.0, focal, rows / 2], [0.0, 0.0, 1.0]]),
            "T_world_cam": pose @ OPENGL_FROM_OPTICAL,
            "width": columns,
            "height": rows,
            "znear": view.near,
            "zfar": view.far,
        }

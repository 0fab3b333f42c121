"""A depth camera that a world declares: depth from rays, and what else is asked for of each pixel."""

from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.model.world import ORIGIN
from anysim.sensors.base import Sensor, SensorField
from anysim.task.scene import Frame, SceneView
from anysim_schemas.base import Degrees, NonNegative, Positive, Vec3
from anysim_sensors.camera import RayCamera
from anysim_sensors.presets import CAMERAS, camera_preset
from anysim_sensors.sight.engine_rays import Source, engine_rays, identified, refuse_engine
from anysim_sensors.sight.eye import Eye, LeftOut, Shapes
from anysim_sensors.sight.identities import Identities

Side = Annotated[int, Field(ge=1, le=4096)]
Channel = Literal["depth", "normals", "instance_id", "class_id", "motion", "appeared"]


class Depth(Sensor):
    """A pinhole camera in the optical frame (x right, y down, z ahead): images (height, width, …) of what is asked for.

    `depth` along z [m], `far` where nothing is seen; `normals` in the world, outward; `instance_id` and `class_id`;
    `motion`, the pixels (columns, rows) by which what is seen has moved since the last reading, exact and zero in the
    first; `appeared` where it was not in sight then, by one more ray a pixel. What is not seen has zeros. It differs
    from a rendered depth image in silhouettes alone, and is the same on every engine.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        frame: Frame,
        preset: Annotated[str | None, Field(description=f"a device: {', '.join(CAMERAS)}")] = None,
        size: Annotated[tuple[Side, Side] | None, Field(description="width and height [pixels]")] = None,
        fov: Annotated[Degrees | None, Field(description="vertical field of view [degrees]")] = None,
        near: Annotated[NonNegative | None, Field(description="what is nearer is not seen, and hides [m]")] = None,
        far: Annotated[Positive | None, Field(description="what is farther is not seen [m]")] = None,
        channels: Annotated[tuple[Channel, ...], Field(min_length=1)] = ("depth",),
        source: Annotated[Source, Field(description="`engine`: its own rays")] = "geometry",
        shapes: Shapes = "collision",
        leave_out: Annotated[LeftOut, Field(description="what carries it, and is not seen")] = "body",
        position: Annotated[Vec3, Field(description="in the frame [m]")] = ORIGIN,
        roll_pitch_yaw: Annotated[Vec3, Field(description="in the frame [rad]; it looks along z, y down")] = ORIGIN,
    ) -> None:
        super().__init__(scene.engine.num_envs)
        device = None if preset is None else camera_preset(preset)
        default = (128, 128, 60.0, 0.05, 10.0)
        if device is not None:
            default = (device.width, device.height, device.fov, device.near, device.far)
        width, height = default[:2] if size is None else size
        given = zip((fov, near, far), default[2:], strict=True)
        angle, near, far = (float(value if own is None else own) for own, value in given)
        if near >= far:
            raise AnysimError(f"`near` ({near:g} m) is less than `far` ({far:g} m)")
        self._scene, self._channels, self._engine = scene, frozenset(channels), source == "engine"
        if self._engine:
            refuse_engine(scene, channels, leave_out, shapes)
        self._camera = RayCamera(width, height, angle, near, far)
        self._eye = Eye(scene, frame, shapes, leave_out, position, roll_pitch_yaw)
        self._named = Identities.of(scene.engine.world)
        image = (height, width)
        every = {
            "depth": SensorField(image, "m", dtype="float32"),
            "normals": SensorField((*image, 3), "1", "world", "float32"),
            "instance_id": SensorField(image, "1", dtype="int32"),
            "class_id": SensorField(image, "1", dtype="int32"),
            "motion": SensorField((*image, 2), "pixel", dtype="float32"),
            "appeared": SensorField(image, "1", dtype="uint8"),
        }
        self.fields = {name: every[name] for name in dict.fromkeys(channels)}
        self._moves = not self._channels.isdisjoint(("motion", "appeared"))
        if self._moves:
            self._bodies = self.remember("bodies", len(scene.engine.world.bodies), 7)
            self._stood = self.remember("stood", 7)

    def reset(self, env_ids: Array) -> None:
        if self._moves:
            self._keep(env_ids)

    def _keep(self, env_ids: Array) -> None:
        self._bodies[env_ids], self._stood[env_ids] = self._scene.state.body_pose[env_ids], self._eye.poses

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        eye, shown, camera, asked = self._eye, self._eye.poses, self._camera, self._channels
        if self._engine:
            return self._asked(env_ids, shown)
        images = camera.images(eye.geometry, eye.posed, shown, seen=eye.seen, normals="normals" in asked)
        values: dict[str, Array] = {"depth": np.where(images.geom < 0, camera.far, images.depth)}
        if "normals" in asked:
            values["normals"] = images.normal * (images.geom >= 0)[..., None]
        values["instance_id"] = self._named.instance[images.segmentation]
        values["class_id"] = self._named.class_[images.segmentation]
        if self._moves:
            before = eye.geometry.posed(self._bodies[env_ids], self._scene.presence[env_ids])
            moments = eye.geometry, images, shown, eye.posed, self._stood[env_ids], before
            flow, appeared = ("motion" in asked, "appeared" in asked)
            moved = camera.motion(*moments, seen=eye.seen, flow=flow, appeared=appeared)
            values |= {"motion": np.nan_to_num(moved.flow), "appeared": moved.appeared}
            self._keep(env_ids)
        return {name: values[name] for name in self.fields}

    def _asked(self, env_ids: Array, shown: Array) -> Mapping[str, Array]:
        """The same of the engine."""
        camera = self._camera
        distance, entity = engine_rays(self._scene, shown, camera.directions, env_ids)
        along = distance * camera.directions[..., 2]
        seen = (along >= camera.near) & (along <= camera.far)
        values = {"depth": np.where(seen, along, camera.far), **identified(self._named, seen, entity)}
        return {name: values[name].reshape(len(env_ids), camera.height, camera.width) for name in self.fields}

"""A LiDAR that a world declares: by the name of a device or by a pattern, from shapes or by the engine's own rays."""

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.model.world import ORIGIN
from anysim.sensors.base import Sensor, SensorField
from anysim.task.scene import Frame, SceneView
from anysim_schemas.base import NonNegative, Positive, Vec3
from anysim_sensors.lidar import lidar
from anysim_sensors.motion.parameters import parameter
from anysim_sensors.presets import LIDARS, lidar_preset
from anysim_sensors.sight.engine_rays import Source, engine_rays, identified, refuse_engine
from anysim_sensors.sight.eye import Eye, LeftOut, Shapes
from anysim_sensors.sight.identities import Identities
from anysim_sensors.sight.lidar_patterns import PatternSpec

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of red, green and blue (Rec. 709): how bright a colour is."""
Channel = Literal["range", "intensity", "instance_id", "class_id"]
FIELDS: Mapping[Channel, SensorField] = {
    "range": SensorField((), "m", dtype="float32"),
    "intensity": SensorField((), "1", dtype="float32"),
    "instance_id": SensorField((), "1", dtype="int32"),
    "class_id": SensorField((), "1", dtype="int32"),
}


class Lidar(Sensor):
    """Ranges [m] along the rays of a pattern, `far` where nothing is met, and what is met there if it is asked for.

    A scan sees one moment. `intensity` is the brightness of the shape's colour times the cosine of the ray's angle to
    its normal, 0 to 1, as of devices that make up for the distance; textures do not count. Patterns that never repeat
    go on with each reading of an episode.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        frame: Frame,
        preset: Annotated[str | None, Field(description=f"a device: {', '.join(LIDARS)}")] = None,
        pattern: PatternSpec | None = None,
        near: Annotated[NonNegative | None, Field(description="what is nearer is not measured, and hides [m]")] = None,
        far: Annotated[Positive | None, Field(description="what is farther is not measured [m]")] = None,
        channels: Annotated[tuple[Channel, ...], Field(min_length=1)] = ("range",),
        source: Annotated[Source, Field(description="`engine`: its own rays")] = "geometry",
        shapes: Shapes = "collision",
        leave_out: Annotated[LeftOut, Field(description="what carries it, and is not seen")] = "body",
        position: Annotated[Vec3, Field(description="in the frame [m]")] = ORIGIN,
        roll_pitch_yaw: Annotated[Vec3, Field(description="in the frame [rad]; it looks along x")] = ORIGIN,
    ) -> None:
        super().__init__(scene.engine.num_envs)
        if (preset is None) == (pattern is None):
            raise AnysimError("a LiDAR has either a `preset` or a `pattern`; give one of them")
        device = None if preset is None else lidar_preset(preset)
        pattern_of = pattern.rays if pattern is not None else device.pattern if device is not None else None
        assert pattern_of is not None
        self._directions = _by_scan(lambda scan: pattern_of(scan).directions)
        self._near = near if near is not None else 0.0 if device is None else device.near
        self._far = far if far is not None else 100.0 if device is None else device.far
        if self._near >= self._far:
            raise AnysimError(f"`near` ({self._near:g} m) is less than `far` ({self._far:g} m)")
        self._scene, self._channels, self._engine = scene, tuple(dict.fromkeys(channels)), source == "engine"
        if self._engine:
            refuse_engine(scene, self._channels, leave_out, shapes)
        self._eye = Eye(scene, frame, shapes, leave_out, position, roll_pitch_yaw)
        self._named = Identities.of(scene.engine.world)
        first, second = self._directions(0), self._directions(1)
        self._repeats = bool((first == second).all())
        self._scan = self.remember("scan")
        self.fields = {name: FIELDS[name]._replace(shape=(len(first),)) for name in self._channels}

    def rays(self, number: int) -> tuple[int, Array, Array, float] | None:
        """Where the rays of the `number`-th reading of an episode are, for those who draw it.

        That is the body that carries it (-1: the world), the pose (7,) there, directions (R, 3) in its axes, and `far`;
        None where it is on a thing that is another one in each episode.
        """
        mount = self._eye.mount
        return None if mount is None else (*mount, self._directions(number), self._far)

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        scans = self._scan[env_ids].astype(int)
        directions = self._directions(0) if self._repeats else np.stack([self._directions(k) for k in scans.tolist()])
        self._scan[env_ids] += 1.0
        if self._engine:
            return self._asked(env_ids, directions)
        eye, shown = self._eye, self._eye.poses
        bright = "intensity" in self._channels
        found = lidar(
            eye.geometry, eye.posed, shown, directions, near=self._near, far=self._far, seen=eye.seen, normals=bright
        )
        values = self._values(found.distance, found.segmentation)
        if bright:
            along = P.rotate(shown[:, None, 3:], np.broadcast_to(directions, found.normal.shape))
            facing = np.abs((along * found.normal).sum(axis=-1))
            values["intensity"] = np.where(found.geom < 0, 0.0, facing * self._brightness(env_ids, found.geom))
        return {name: values[name] for name in self._channels}

    def _values(self, distance: Array, entity: Array) -> dict[str, Array]:
        met = np.isfinite(distance)
        return {"range": np.where(met, distance, self._far), **identified(self._named, met, entity)}

    def _asked(self, env_ids: Array, directions: Array) -> Mapping[str, Array]:
        """The same of the engine."""
        distance, entity = engine_rays(self._scene, self._eye.poses, directions, env_ids)
        measured = (distance >= self._near) & (distance <= self._far)
        values = self._values(np.where(measured, distance, np.inf), entity)
        return {name: values[name] for name in self._channels}

    def _brightness(self, env_ids: Array, geom: Array) -> Array:
        every = np.arange(len(self._scene.engine.world.geoms))
        colors = parameter(self._scene.engine, "geom.color", env_ids, every)
        return np.take_along_axis(colors[..., :3] @ LUMINANCE, np.maximum(geom, 0), axis=1)


def _by_scan(made: Callable[[int], Array]) -> Callable[[int], Array]:
    """The same, each made once: envs whose episodes are of one age look along the same rays."""
    return lru_cache(maxsize=64)(made)

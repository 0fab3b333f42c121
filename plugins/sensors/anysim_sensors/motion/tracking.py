"""Tracking of a frame, as a motion capture system or a beacon does."""

from collections.abc import Mapping

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.sensors.base import Sensor, SensorField
from anysim.task.scene import Frame, SceneView


class Tracking(Sensor):
    """Pose and twist of a frame in the world, or as seen from another frame that may move itself, in its axes."""

    def __init__(self, scene: SceneView, *, frame: Frame, relative_to: Frame | None = None) -> None:
        super().__init__(scene.engine.num_envs)
        self._frame, self._base = frame, relative_to
        axes = "world" if relative_to is None else relative_to.name
        self.fields = {
            "position": SensorField((3,), "m", axes),
            "quaternion": SensorField((4,), "xyzw", axes),
            "velocity": SensorField((3,), "m/s", axes),
            "angular_velocity": SensorField((3,), "rad/s", axes),
        }

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        pose, twist = self._frame.pose, self._frame.twist
        if self._base is not None:
            base, moving = self._base.pose, self._base.twist
            carried = moving[:, :3] + P.cross(moving[:, 3:], pose[:, :3] - base[:, :3])
            parts = (twist[:, :3] - carried, twist[:, 3:] - moving[:, 3:])
            velocity, rate = (P.rotate_inverse(base[:, 3:], part) for part in parts)
            pose = P.compose(P.inverse(base), pose)
        else:
            velocity, rate = twist[:, :3], twist[:, 3:]
        pose = P.unsigned(pose)
        return {"position": pose[:, :3], "quaternion": pose[:, 3:], "velocity": velocity, "angular_velocity": rate}

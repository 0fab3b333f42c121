"""An inertial measurement unit: specific force and rate in its own axes, averages over its period."""

from collections.abc import Mapping

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.sensors.base import Sensor, SensorField
from anysim.task.scene import Frame, SceneView
from anysim_sensors.motion.parameters import gravity


class Imu(Sensor):
    """What a unit that integrates reads at the end of its period T, of a frame that is fixed to a body.

    Both are changes over the period divided by T, so they tell of its middle, t - T/2, as `time` says: the change of
    the frame's velocity, less gravity, in the axes that it has half way; and the turn of the frame. No impact between
    two readings is missed. A turn of more than half a circle in a period is read as one the other way round. The first
    reading of an episode is of a frame that does not accelerate.
    """

    def __init__(self, scene: SceneView, *, frame: Frame) -> None:
        super().__init__(scene.engine.num_envs)
        self._scene, self._frame = scene, frame
        self._velocity, self._turn = self.remember("velocity", 3), self.remember("turn", 4)
        self.fields = {
            "acceleration": SensorField((3,), "m/s^2", frame.name),
            "angular_velocity": SensorField((3,), "rad/s", frame.name),
        }

    @property
    def age(self) -> float:
        return 0.5 * self.period

    def reset(self, env_ids: Array) -> None:
        self._velocity[env_ids], self._turn[env_ids] = self._frame.twist[:, :3], self._frame.quaternion

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        twist, turn, before = self._frame.twist, self._frame.quaternion, self._turn[env_ids]
        turned = P.rotation_vector(P.multiply(P.conjugate(before), turn))
        gained = twist[:, :3] - self._velocity[env_ids]
        self._velocity[env_ids], self._turn[env_ids] = twist[:, :3], turn
        midway = P.multiply(before, P.from_rotation_vector(0.5 * turned))
        first = self._scene.elapsed[env_ids, None] == 0
        return {
            "acceleration": P.rotate_inverse(midway, gained / self.period - gravity(self._scene.engine, env_ids)),
            "angular_velocity": np.where(first, P.rotate_inverse(turn, twist[:, 3:]), turned / self.period),
        }

"""Joint sensors: encoders, tachometers, and the efforts of the drives."""

from collections.abc import Mapping

import numpy as np

from anysim.controllers.base import columns
from anysim.conventions import Array
from anysim.sensors.base import Sensor, SensorField
from anysim.task.scene import RobotView, SceneView


class Joints(Sensor):
    """Of all joints of a robot, or of those of one channel, in its order."""

    def __init__(self, scene: SceneView, *, robot: RobotView, channel: str | None = None) -> None:
        super().__init__(scene.engine.num_envs)
        own = np.arange(robot.joints.start, robot.joints.stop)
        joints = own if channel is None else np.array(robot.channel(channel).joints, dtype=int)
        self._scene, self._joints, shape = scene, columns(joints), (len(joints),)
        self.fields = {
            "position": SensorField(shape, "rad or m"),
            "velocity": SensorField(shape, "rad/s or m/s"),
            "effort": SensorField(shape, "N m or N"),
        }

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        state = self._scene.state
        values = {"position": state.joint_pos, "velocity": state.joint_vel, "effort": state.joint_effort}
        return {key: array[env_ids][:, self._joints] for key, array in values.items()}

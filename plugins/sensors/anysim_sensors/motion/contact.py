"""A contact sensor as a sensor: with a rate, noise and delay, and in axes of its own."""

from collections.abc import Mapping

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.sensors.base import Sensor, SensorField
from anysim.task.references import ContactView
from anysim.task.scene import Frame, SceneView


class Contact(Sensor):
    """The net force on the body of a contact sensor in the last substep, in the world's axes or in those of a frame."""

    def __init__(self, scene: SceneView, *, of: ContactView, frame: Frame | None = None) -> None:
        super().__init__(scene.engine.num_envs)
        self._of, self._frame = of, frame
        self.fields = {"force": SensorField((3,), "N", "world" if frame is None else frame.name)}

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        force = self._of.force
        return {"force": force if self._frame is None else P.rotate_inverse(self._frame.quaternion, force)}

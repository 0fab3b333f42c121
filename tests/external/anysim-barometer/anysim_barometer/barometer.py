"""The pressure of the air at a frame, as a gauge that is slow reads it."""

from collections.abc import Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.sensors.base import Sensor, SensorField
from anysim.task.scene import Frame, SceneView

SEA_LEVEL, SCALE_HEIGHT = 101_325.0, 8_434.0
"""[Pa] and [m] of an atmosphere of one temperature, 15 degrees Celsius."""


class Barometer(Sensor):
    """Follows the pressure with a time constant: what it has read before is part of what it reads."""

    def __init__(
        self,
        scene: SceneView,
        *,
        frame: Frame,
        lag: Annotated[float, Field(ge=0, description="time constant of the gauge [s]")] = 0.1,
        altitude: Annotated[float, Field(description="of the world's origin above the sea [m]")] = 0.0,
    ) -> None:
        super().__init__(scene.engine.num_envs)
        self._frame, self._lag, self._altitude = frame, lag, altitude
        self._gauge = self.remember("gauge")
        self.fields = {"pressure": SensorField((), "Pa"), "altitude": SensorField((), "m")}

    def reset(self, env_ids: Array) -> None:
        self._gauge[env_ids] = self._pressure()

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        keeps = np.exp(-self.period / self._lag) if self._lag else 0.0
        self._gauge[env_ids] = keeps * self._gauge[env_ids] + (1.0 - keeps) * self._pressure()
        pressure = self._gauge[env_ids]
        return {"pressure": pressure, "altitude": -SCALE_HEIGHT * np.log(pressure / SEA_LEVEL)}

    def _pressure(self) -> Array:
        """(n,) [Pa] where the frame is."""
        return SEA_LEVEL * np.exp(-(self._frame.position[:, 2] + self._altitude) / SCALE_HEIGHT)

"""Contact sensors and other sensors of the world, as terms see them."""

from typing import ClassVar

import numpy as np

from anysim.conventions import Array
from anysim.errors import NameLookupError, listing, suggest
from anysim.managers.sensors import EVERY_SENSOR
from anysim.math import pose as P
from anysim.task.scene import SceneView


class ContactView:
    """A contact sensor. In YAML: its name under `world.contact_sensors`."""

    reference_kind: ClassVar[str] = "contact sensor"

    def __init__(self, scene: SceneView, name: str) -> None:
        known = [sensor.name for sensor in scene.engine.world.contact_sensors]
        if name not in known:
            raise NameLookupError(
                f"there is no contact sensor '{name}'{suggest(name, known)} (contact sensors: {listing(known)}); "
                f"declare it as `world.contact_sensors.{name}: {{body: …, against: …}}`"
            )
        self.scene, self._index = scene, known.index(name)

    @property
    def force(self) -> Array:
        """(n, 3) [N] on the sensor's body, world axes: the net force of its contacts in the last substep."""
        return self.scene.state.contact_force[self.scene.rows, self._index]

    @property
    def strength(self) -> Array:
        """(n,) [N] size of the force."""
        return P.norm(self.force)


class SensorView:
    """What is seen of a sensor. In YAML: its name under `world.sensors`, or one of its fields, `imu.acceleration`."""

    reference_kind: ClassVar[str] = "sensor"

    def __init__(self, scene: SceneView, name: str) -> None:
        if scene.sensors is None:
            raise NameLookupError(f"there is no sensor '{name}': the world has none; declare it under `world.sensors`")
        self.scene, (self.name, _, field) = scene, name.partition(".")
        self._manager, every = scene.sensors, scene.sensors.fields(self.name)
        self.fields = (field,) if field else tuple(key for key in every if key not in EVERY_SENSOR)
        """Those that are meant: one, or all of the sensor's own."""
        self.values()

    def values(self) -> Array:
        """(n, k): the fields, one after the other."""
        parts = [self._manager.reading(self.name, key, self.scene.rows) for key in self.fields]
        return np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1, dtype=np.float64)

"""One contact sensor of the world, as terms see it."""

from typing import ClassVar

from anysim.conventions import Array
from anysim.errors import NameLookupError, listing, suggest
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

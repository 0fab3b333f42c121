"""Holes, inner spaces, points, sensors and conditions, as terms see them."""

from collections.abc import Callable, Sequence
from math import isfinite
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import NameLookupError, listing, suggest
from anysim.geometry import polygon as G
from anysim.geometry.convex_parts import IDENTITY, Pose, Solid
from anysim.managers.sensors import EVERY_SENSOR
from anysim.math import pose as P
from anysim.model.affordance_lookup import find_affordance
from anysim.model.affordances import AffordanceKind
from anysim.model.world import World
from anysim.placement.support_surfaces import choose, surfaces
from anysim.task.scene import SceneView
from anysim.task.slot_frames import CategoryView
from anysim_schemas.base import Name, Reference
from anysim_schemas.task import ByTerm, PredicateTermSpec


class HoleView:
    """What something goes into, along -z of its frame. In YAML: `block/mouth`."""

    reference_kind: ClassVar[str] = "hole"

    def __init__(self, scene: SceneView, name: str) -> None:
        owner, _, local = name.partition("/")
        found = find_affordance(scene.engine.world, f"{owner}.{local}")
        if found.spec.kind is not AffordanceKind.HOLE:
            raise NameLookupError(f"'{name}' is a {found.spec.kind}, and nothing goes into it; name a hole")
        self.frame = scene.frame(f"{owner}/{found.spec.name}")
        self.depth, self.clearance = found.spec.depth, found.spec.clearance


class InnerSpace(NamedTuple):
    """The room inside of an entity, as a box that moves with one of its bodies.

    `low` and `high` (3,) [m] are corners in the axes of the root as it is at first, `mount` (7,) is the body there.
    """

    body: int
    mount: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, world: World, name: str, part: str = "") -> "InnerSpace":
        """That over the largest floor with walls around it, or with something above it; or over a certain one.

        Raises:
            NameLookupError: the entity has none; lists the surfaces that it has.
        """
        solid = Solid(world, world.entities[world.entity_numbers[name]])
        every = surfaces(world, solid)
        found = choose(every, part, inside=True)
        if found is None:
            wanted = f"no surface '{part}'" if part else "no floor that walls surround"
            raise NameLookupError(f"'{name}' has {wanted} (surfaces: {listing([one.name for one in every])})")
        top = found.height + found.headroom
        if not isfinite(top):
            top = max(placed.high[2] for placed in solid.at(Pose((0.0, 0.0, 0.0), IDENTITY)).parts)
        (x0, y0), (x1, y1) = G.bounds((found.polygon,))
        root = world.initial_body_pose[world.entities[world.entity_numbers[name]].root]
        mount = P.compose(P.inverse(root), world.initial_body_pose[found.body])
        return cls(found.body, mount, np.array([x0, y0, found.height]), np.array([x1, y1, top]))

    def holds(self, body_pose: Array, position: Array, rim: float) -> Array:
        """Whether positions (n, 3) are in it, `rim` [m] or more below its upper end; of bodies at poses (n, 7)."""
        place = P.rotate_inverse(body_pose[:, 3:], position - body_pose[:, :3])
        turn = np.broadcast_to(self.mount[3:], (len(place), 4))
        seen = self.mount[:3] + P.rotate(turn, place)
        return np.all((seen >= self.low) & (seen <= self.high - np.array([0.0, 0.0, rim])), axis=1)


class PointsView:
    """Several points. In YAML: a category, or a list of categories, frames and goals."""

    reference_kind: ClassVar[str] = "set of points"
    written_as = Reference | tuple[Reference, ...]

    def __init__(self, scene: SceneView, names: str | Sequence[str]) -> None:
        every = [names] if isinstance(names, str) else names
        categories = scene.engine.world.categories
        self._parts = [CategoryView(scene, name) if name in categories else scene.frame(name) for name in every]

    @property
    def positions(self) -> Array:
        """(n, K, 3) [m]."""
        return np.concatenate(
            [part.positions if isinstance(part, CategoryView) else part.position[:, None] for part in self._parts],
            axis=1,
        )

    @property
    def present(self) -> Array:
        """(n, K) bool: which of them are there."""
        each = (part.present.reshape(len(part.present), -1) for part in self._parts)
        return np.concatenate(list(each), axis=1)


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


class Conditions:
    """What a predicate combines. In YAML: a mapping of predicates, as under `success`."""

    reference_kind: ClassVar[str] = "condition"
    written_as = Annotated[dict[Name, PredicateTermSpec], ByTerm, Field(min_length=1)]

    def __init__(self, calls: Sequence[Callable[[], Array]]) -> None:
        self._calls = tuple(calls)

    def __len__(self) -> int:
        """How many they are."""
        return len(self._calls)

    def each(self) -> Array:
        """(C, n) bool: which of them hold."""
        return np.stack([call() for call in self._calls])

    def all(self) -> Array:
        """(n,) bool: whether all of them hold."""
        return np.logical_and.reduce(self.each())

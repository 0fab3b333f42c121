"""The place that a sensor looks from, and the shapes of the scene, posed once a moment for all sensors."""

from typing import Literal
from weakref import WeakKeyDictionary

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.slots import single
from anysim.model.world import ORIGIN, Vec3
from anysim.task.scene import BodyFrame, Frame, SceneView, SlotFrame
from anysim_sensors.scene import SceneGeometry
from anysim_sensors.tables import GeomPoses

Shapes = Literal["collision", "visual"]
LeftOut = Literal["body", "entity", "nothing"]


class _Scenery:
    """The geometry of a scene, and where it is in the envs that the scene looks at."""

    def __init__(self, scene: SceneView, shapes: Shapes) -> None:
        self.geometry = SceneGeometry(scene.engine.world, shapes)
        self._moment = (-1, -1)

    def at(self, scene: SceneView) -> GeomPoses:
        moment = (scene.moment, scene.population)
        if moment != self._moment:
            self._poses = self.geometry.posed(scene.state.body_pose[scene.rows], scene.presence[scene.rows])
            self._moment = moment
        return self._poses


_SCENES: WeakKeyDictionary[SceneView, dict[Shapes, _Scenery]] = WeakKeyDictionary()
"""One geometry for all sensors of an env: its tables are large, and poses are worked out once a moment."""


class Eye:
    """A place on a frame, turned against it, from which the scene is seen without what carries it.

    Attributes:
        geometry: the shapes.
        seen: (G,) bool, those that are seen.
    """

    def __init__(
        self,
        scene: SceneView,
        frame: Frame,
        shapes: Shapes,
        leave_out: LeftOut,
        position: Vec3 = ORIGIN,
        roll_pitch_yaw: Vec3 = ORIGIN,
    ) -> None:
        self._scene, self._frame = scene, frame
        self._place = P.pose(position, P.from_roll_pitch_yaw(np.array(roll_pitch_yaw, dtype=float)))
        every = _SCENES.setdefault(scene, {})
        if shapes not in every:
            every[shapes] = _Scenery(scene, shapes)
        self._scenery = every[shapes]
        self.geometry = self._scenery.geometry
        self.seen = self.geometry.without(_carriers(scene, frame, leave_out))

    @property
    def poses(self) -> Array:
        """(n, 7) of it in the envs that the scene looks at, world frame."""
        return P.compose(self._frame.pose, self._place)

    @property
    def mount(self) -> tuple[int, Array] | None:
        """The body that carries it, -1 for the world, and its pose (7,) there; None where that is not one for good."""
        if not isinstance(self._frame, BodyFrame):
            return None
        fixed = self._frame.index
        return fixed.body, P.compose(np.array([*fixed.position, *fixed.quaternion]), self._place)

    @property
    def posed(self) -> GeomPoses:
        """Where the shapes are in these envs."""
        return self._scenery.at(self._scene)


def _carriers(scene: SceneView, frame: Frame, leave_out: LeftOut) -> set[int]:
    """The bodies that are not seen: that which carries the frame, or all of the entity that it is on."""
    world = scene.engine.world
    if leave_out == "nothing" or not isinstance(frame, BodyFrame | SlotFrame):
        return set()
    if isinstance(frame, BodyFrame):
        if frame.index.body < 0:
            return set()
        if leave_out == "body":
            return {frame.index.body}
        entities: tuple[int, ...] = (world.body_entity[frame.index.body],)
    else:  # another thing in each env, all of it: what carries the frame is another body each
        entities = single(world, frame.name.partition("/")[0].partition(".")[0]).entities
    return {body for e in entities for body in range(world.entities[e].body_start, world.entities[e].body_stop)}

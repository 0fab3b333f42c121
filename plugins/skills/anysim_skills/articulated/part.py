"""Parts on joints: where a point of a drawer or a door goes when its joint moves."""

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.model.world import JointType
from anysim.task.joints import JointView, RangedJointView
from anysim.task.scene import Frame, ObjectView, SceneView


class JointedPart:
    """The moving part of a joint.

    Attributes:
        owner: the object that it is a part of.

    Raises:
        TaskError: the reference stands for joints of several objects.
    """

    def __init__(self, scene: SceneView, joint: JointView) -> None:
        if len(joint.found) != 1:
            raise TaskError(f"'{joint.name}' is a joint of several objects; a handle is found on one alone")
        world = scene.engine.world
        found = joint.found[0]
        self.scene, self._joint = scene, joint
        self._number = next(j for j, other in enumerate(world.joints) if other is found)
        self.body = world.body_joint.index(self._number)
        entity = world.body_entity[self.body]
        self.owner = ObjectView(
            scene, next(name for name, slot in world.logical_objects.items() if entity in slot.entities)
        )
        self._slides = found.type is JointType.PRISMATIC
        self._axis, self._anchor = np.array(found.axis, dtype=float), np.array(found.anchor, dtype=float)

    def handle(self) -> Frame:
        """Its frame `<part>.handle`."""
        return self.scene.frame(f"{self.scene.engine.world.bodies[self.body].name}.handle")

    def pose(self, at: Array) -> Array:
        """(n, 7) of the part now."""
        return self.scene.state.body_pose[self.scene.env_ids[at], self.body]

    def position(self, at: Array) -> Array:
        """(n,) [m, rad] of the joint."""
        return self._joint.position[at]

    def moved(self, at: Array, poses: Array, by: Array) -> Array:
        """Poses (n, g, 7) that are fixed to the part, after its joint has moved `by` (n, g) [m, rad] from here."""
        part = self.pose(at)[:, None]
        axis = P.rotate(part[..., 3:], np.broadcast_to(self._axis, (*part.shape[:-1], 3)))
        if self._slides:
            return np.concatenate([poses[..., :3] + by[..., None] * axis, poses[..., 3:]], axis=-1)
        anchor = part[..., :3] + P.rotate(part[..., 3:], np.broadcast_to(self._anchor, (*part.shape[:-1], 3)))
        turn = P.from_axis_angle(np.broadcast_to(axis, (*by.shape, 3)), by)
        place = anchor + P.rotate(turn, poses[..., :3] - anchor)
        return np.concatenate([place, P.multiply(turn, poses[..., 3:])], axis=-1)

    def reach(self, point: Array, at: Array) -> Array:
        """(n,) [m] that a point (n, 3) moves for a unit of the joint: 1 for a slide, its distance from a hinge."""
        if self._slides:
            return np.ones(len(point))
        part = self.pose(at)
        axis = P.rotate(part[:, 3:], np.broadcast_to(self._axis, (len(part), 3)))
        arm = point - part[:, :3] - P.rotate(part[:, 3:], np.broadcast_to(self._anchor, (len(part), 3)))
        return P.norm(arm - P.dot(arm, axis)[:, None] * axis)


class Part(JointedPart):
    """The moving part of a joint that has limits.

    Attributes:
        joint: the joint, which says how far it is open.
        closed: its position [m, rad] when closed.
        span: [m, rad] its signed way from closed to open.
    """

    def __init__(self, scene: SceneView, joint: RangedJointView) -> None:
        super().__init__(scene, joint)
        self.joint = joint
        lower, upper = joint.found[0].lower, joint.found[0].upper
        self.closed = lower if abs(lower) <= abs(upper) else upper
        self.span = (upper if self.closed == lower else lower) - self.closed

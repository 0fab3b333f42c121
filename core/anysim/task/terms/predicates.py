"""Predicates for success and failure: `(scene, *, parameters) -> (n,) bool`."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.task.joints import JointView, RangedJointView
from anysim.task.references import ContactView, HoleView, InnerSpace, PointsView
from anysim.task.scene import Frame, ObjectView, RobotView, SceneView
from anysim.task.slot_frames import CategoryView
from anysim.task.terms.geometry import Axes, Axis, along, axis_of, turned_by
from anysim_schemas.base import Number

Metres = Annotated[float, Field(gt=0, description="[m]")]
Corner = tuple[Number, Number, Number]
Newtons = Annotated[float, Field(gt=0, description="[N]")]
Radians = Annotated[float, Field(gt=0, description="[rad]")]


def near(
    scene: SceneView,
    *,
    a: Frame,
    b: Frame,
    tolerance: Metres,
    axes: Axes = "xyz",
    frame: Annotated[Literal["world", "a", "b"], Field(description="whose axes they are")] = "world",
) -> Array:
    """The origins of two frames are at most `tolerance` apart, along these axes."""
    apart = b.position - a.position
    if frame != "world":
        apart = P.rotate_inverse((a if frame == "a" else b).quaternion, apart)
    return along(apart, axes) <= tolerance


def points_near(scene: SceneView, *, a: PointsView, b: PointsView, mean: Metres, most: Metres | None = None) -> Array:
    """Points are near others, one by one: those that are there at most `mean` apart on average, none beyond `most`."""
    there = a.present & b.present
    apart = np.where(there, P.norm(a.positions - b.positions), 0.0)
    average = apart.sum(axis=1) / np.maximum(there.sum(axis=1), 1)
    return (average <= mean) & (apart.max(axis=1) <= (most or np.inf)) & there.any(axis=1)


def aligned(
    scene: SceneView,
    *,
    a: Frame,
    b: Frame,
    tolerance: Radians = 0.1,
    axis: Literal["x", "y", "z", "all"] = "all",
    symmetry: Annotated[
        int, Field(ge=1, description="of b about its z axis: 4 for a square peg; needs axis `all`")
    ] = 1,
) -> Array:
    """Two frames have the same orientation, or one axis in common: at most `tolerance` apart."""
    if axis == "all":
        return turned_by(a.quaternion, b.quaternion, symmetry) <= tolerance
    same = P.dot(axis_of(a.quaternion, axis), axis_of(b.quaternion, axis))
    return np.arccos(np.clip(same, -1.0, 1.0)) <= tolerance


def further_than(scene: SceneView, *, a: Frame, b: Frame, distance: Metres) -> Array:
    """The origins of two frames are more than `distance` apart."""
    return P.norm(b.position - a.position) > distance


def at_rest(
    scene: SceneView, *, robot: RobotView, speed: Annotated[float, Field(gt=0, description="[rad/s, m/s]")] = 0.2
) -> Array:
    """No joint of the robot outside its grippers moves faster than `speed`."""
    return robot.arm_speed <= speed


def below(scene: SceneView, *, frame: Frame, height: float) -> Array:
    """The frame's origin is lower than `height` [m] in the world."""
    return frame.position[:, 2] < height


def above(
    scene: SceneView,
    *,
    a: Frame,
    b: Frame,
    height: Annotated[float, Field(description="of a's origin over b's, along the world's z [m]")] = 0.0,
    tolerance: Annotated[float, Field(gt=0, description="of the height [m]")] = 0.005,
    distance: Annotated[float, Field(gt=0, description="at most so far apart horizontally [m]")] = 0.03,
) -> Array:
    """The origin of a is a height above that of b, and not far to the side: a stack, a thing on a pad."""
    apart = a.position - b.position
    return (np.abs(apart[:, 2] - height) <= tolerance) & (P.norm(apart[:, :2]) <= distance)


def inside(scene: SceneView, *, a: Frame, b: Frame, low: Corner, high: Corner) -> Array:
    """The origin of a is in a box between two corners, in the axes of b [m]: a bin, a drawer, the end of a hole."""
    place = P.rotate_inverse(b.quaternion, a.position - b.position)
    return np.logical_and.reduce((place >= np.array(low)) & (place <= np.array(high)), axis=1)


class Contained:
    """The origin of a is in the room inside of an object: over its floor, between its walls, not above its rim.

    The room is a box over the largest floor with walls around it or with something above it, or over the surface, or on
    the link, that `part` names; it moves with that link.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        a: Frame,
        b: ObjectView,
        part: str = "",
        rim: Annotated[float, Field(description="at least so far below the rim [m]")] = 0.0,
    ) -> None:
        self._scene, self._a, self._b, self._rim = scene, a, b, rim
        self._spaces = {one.name: InnerSpace.of(scene.engine.world, one.name, part) for one in b.entities}

    def __call__(self) -> Array:
        scene = self._scene
        held, position = np.zeros(scene.engine.num_envs, dtype=bool), np.zeros((scene.engine.num_envs, 3))
        position[scene.env_ids] = self._a.position
        for entity, ids in self._b.by_entity(scene.env_ids):
            space = self._spaces[entity.name]
            held[ids] = space.holds(scene.state.body_pose[ids, space.body], position[ids], self._rim)
        return held[scene.rows]


def inserted(
    scene: SceneView,
    *,
    a: Frame,
    hole: HoleView,
    share: Annotated[float, Field(gt=0, description="of the hole's depth")] = 0.9,
    lateral: Annotated[float, Field(gt=0, description="from its axis [m]; the clearance where left out")] | None = None,
) -> Array:
    """The origin of a, such as the tip of a peg, is so far in a hole that its asset declares, and near its axis."""
    place = P.rotate_inverse(hole.frame.quaternion, a.position - hole.frame.position)
    aside = hole.clearance if lateral is None else lateral
    return (-place[:, 2] >= share * hole.depth) & (P.norm(place[:, :2]) <= aside)


def count_inside(
    scene: SceneView,
    *,
    category: CategoryView,
    b: Frame,
    low: Corner,
    high: Corner,
    count: Annotated[int, Field(ge=1, description="at least so many")],
) -> Array:
    """Things of a category that are in a box between two corners, in the axes of b [m]: poured, tidied, collected."""
    turned = np.broadcast_to(b.quaternion[:, None], (*category.positions.shape[:2], 4))
    place = P.rotate_inverse(turned, category.positions - b.position[:, None])
    inside = ((place >= np.array(low)) & (place <= np.array(high))).all(axis=2) & category.present
    return inside.sum(axis=1) >= count


class Visible:
    """An object's origin is in a camera's image, at a distance, and enough of the image's pixels show the object.

    `pixels` counts them in the segmentation image, so it knows what hides the object: the camera needs `segmentation`
    among its `channels`, and is drawn in each control step.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        camera: Annotated[str, Field(description="of world.cameras")],
        object: ObjectView,
        within: Annotated[float, Field(gt=0, le=1, description="of half the image, from its middle")] = 1.0,
        nearest: Annotated[float, Field(ge=0, description="along the optical axis [m]")] = 0.0,
        farthest: Metres | None = None,
        pixels: Annotated[int, Field(ge=0, description="0 asks for none")] = 0,
    ) -> None:
        lens = scene.engine.world.cameras[scene.index.camera(camera)]
        if pixels and "segmentation" not in lens.channels:
            raise TaskError(f"`pixels` needs segmentation; add it to world.cameras.{camera}.channels")
        self._scene, self._camera, self._object, self._within, self._pixels = scene, camera, object, within, pixels
        self._nearest, self._farthest = max(nearest, lens.near), farthest or lens.far
        self._aspect, self._ids = lens.width / lens.height, scene.index.segmentation_ids(object.name)

    def __call__(self) -> Array:
        root, view = self._object.root, self._scene.engine.camera_view(self._camera, self._scene.env_ids)
        seen = P.rotate_inverse(view.pose[:, 3:], root.position - view.pose[:, :3])
        half, depth = np.tan(np.radians(view.fov) / 2) * np.maximum(seen[:, 2], 1e-9), seen[:, 2]
        off = np.maximum(np.abs(seen[:, 0]) / self._aspect, np.abs(seen[:, 1])) / half
        there = (depth >= self._nearest) & (depth <= self._farthest) & (off <= self._within) & root.present
        if not self._pixels:
            return there
        assert self._scene.capture is not None
        seen = self._scene.capture.segmentation(self._camera, self._scene.env_ids)
        return there & (np.isin(seen, self._ids).sum(axis=(1, 2)) >= self._pixels)


def upright(scene: SceneView, *, frame: Frame, tolerance: Radians = 0.1, axis: Axis = "z") -> Array:
    """An axis of the frame points up; `-z` is its z axis downwards."""
    up = axis_of(frame.quaternion, axis)
    return np.arctan2(P.norm(up[:, :2]), up[:, 2]) <= tolerance


def touching(scene: SceneView, *, sensor: ContactView, force: Newtons = 0.5, most: Newtons | None = None) -> Array:
    """A contact sensor feels at least `force`, and at most `most` where that is given; `not` it is free of contact."""
    return (sensor.strength >= force) & (sensor.strength <= (np.inf if most is None else most))


def grasped(
    scene: SceneView,
    *,
    left: ContactView,
    right: ContactView,
    force: Newtons = 0.5,
    angle: Annotated[
        float, Field(gt=0, le=np.pi, description="the two forces oppose each other within it [rad]")
    ] = 1.5,
) -> Array:
    """Two contact sensors on the fingers of a gripper feel at least `force` each, in opposite directions."""
    first, second = left.strength, right.strength
    opposed = -P.dot(left.force, right.force) >= np.cos(angle) * first * second
    return (first >= force) & (second >= force) & opposed


def still(
    scene: SceneView,
    *,
    frame: Frame,
    speed: Annotated[float, Field(gt=0, description="[m/s]")] = 0.01,
    rate: Annotated[float, Field(gt=0, description="[rad/s]")] = 0.5,
) -> Array:
    """What the frame is fixed to moves no faster than `speed` there and turns no faster than `rate`."""
    twist = frame.twist
    return (P.norm(twist[:, :3]) <= speed) & (P.norm(twist[:, 3:]) <= rate)


def opened(
    scene: SceneView,
    *,
    joint: RangedJointView,
    share: Annotated[float, Field(ge=0, le=1, description="of the range")] = 0.75,
) -> Array:
    """A joint is open by at least a share of its range: a drawer, a door, a lid, a tap."""
    return joint.opening >= share


def closed(
    scene: SceneView,
    *,
    joint: RangedJointView,
    share: Annotated[float, Field(ge=0, le=1, description="of the range")] = 0.05,
) -> Array:
    """A joint is open by at most a share of its range."""
    return joint.opening <= share


def joint_above(scene: SceneView, *, joint: JointView, position: float) -> Array:
    """A joint is at `position` [rad, m] or above."""
    return joint.position >= position


def joint_below(scene: SceneView, *, joint: JointView, position: float) -> Array:
    """A joint is at `position` [rad, m] or below."""
    return joint.position <= position


def joint_still(
    scene: SceneView, *, joint: JointView, speed: Annotated[float, Field(gt=0, description="[rad/s, m/s]")] = 0.05
) -> Array:
    """A joint moves no faster than `speed`."""
    return np.abs(joint.velocity) <= speed


def present(scene: SceneView, *, object: ObjectView) -> Array:
    """The object is there in this episode."""
    return object.present

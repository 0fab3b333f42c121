"""Predicates for success and failure: `(scene, *, parameters) -> (n,) bool`."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.contact_view import ContactView
from anysim.task.joints import JointView, RangedJointView
from anysim.task.scene import Frame, ObjectView, RobotView, SceneView
from anysim.task.slot_frames import CategoryView
from anysim.task.terms.geometry import AXES, Axes, Axis, axis_of, turned_by
from anysim_schemas.base import Number

__all__ = [
    "above", "aligned", "at_rest", "below", "closed", "count_inside", "further_than", "grasped", "inside",
    "joint_above", "joint_below", "joint_still", "near", "opened", "present", "still", "touching", "upright",
]  # fmt: skip

Metres = Annotated[float, Field(gt=0, description="[m]")]
Corner = tuple[Number, Number, Number]
Newtons = Annotated[float, Field(gt=0, description="[N]")]
Radians = Annotated[float, Field(gt=0, description="[rad]")]


def near(scene: SceneView, *, a: Frame, b: Frame, tolerance: Metres, axes: Axes = "xyz") -> Array:
    """The origins of two frames are at most `tolerance` apart, along these axes of the world."""
    apart = b.position - a.position
    return P.norm(apart if axes == "xyz" else apart[:, AXES[axes]]) <= tolerance


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
    along = P.dot(axis_of(a.quaternion, axis), axis_of(b.quaternion, axis))
    return np.arccos(np.clip(along, -1.0, 1.0)) <= tolerance


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


def upright(scene: SceneView, *, frame: Frame, tolerance: Radians = 0.1, axis: Axis = "z") -> Array:
    """An axis of the frame points up; `-z` is its z axis downwards."""
    up = axis_of(frame.quaternion, axis)
    return np.arctan2(P.norm(up[:, :2]), up[:, 2]) <= tolerance


def touching(scene: SceneView, *, sensor: ContactView, force: Newtons = 0.5) -> Array:
    """A contact sensor feels at least `force`; `not` it is free of contact."""
    return sensor.strength >= force


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

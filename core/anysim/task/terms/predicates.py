"""Predicates for success and failure: `(scene, *, parameters) -> (n,) bool`."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.joints import JointView, RangedJointView
from anysim.task.scene import Frame, ObjectView, RobotView, SceneView

__all__ = [
    "at_rest", "below", "closed", "further_than", "joint_above", "joint_below", "joint_still", "near", "opened",
    "present",
]  # fmt: skip


def near(scene: SceneView, *, a: Frame, b: Frame, tolerance: Annotated[float, Field(gt=0, description="[m]")]) -> Array:
    """The origins of two frames are at most `tolerance` apart."""
    return P.norm(b.position - a.position) <= tolerance


def further_than(
    scene: SceneView, *, a: Frame, b: Frame, distance: Annotated[float, Field(gt=0, description="[m]")]
) -> Array:
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

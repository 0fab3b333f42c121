"""Predicates for success and failure: `(scene, *, parameters) -> (n,) bool`."""

from typing import Annotated

from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.view import Frame, ObjectView, RobotView, SceneView

__all__ = ["at_rest", "below", "further_than", "near", "present"]


def near(
    scene: SceneView, *, a: Frame, b: Frame,
    tolerance: Annotated[float, Field(gt=0, description="[m]")],
) -> Array:  # fmt: skip
    """The origins of two frames are at most `tolerance` apart."""
    return P.norm(b.position - a.position) <= tolerance


def further_than(
    scene: SceneView, *, a: Frame, b: Frame,
    distance: Annotated[float, Field(gt=0, description="[m]")],
) -> Array:  # fmt: skip
    """The origins of two frames are more than `distance` apart."""
    return P.norm(b.position - a.position) > distance


def at_rest(
    scene: SceneView, *, robot: RobotView,
    speed: Annotated[float, Field(gt=0, description="[rad/s, m/s]")] = 0.2,
) -> Array:  # fmt: skip
    """No joint of the robot outside its grippers moves faster than `speed`."""
    return robot.arm_speed <= speed


def below(scene: SceneView, *, frame: Frame, height: float) -> Array:
    """The frame's origin is lower than `height` [m] in the world."""
    return frame.position[:, 2] < height


def present(scene: SceneView, *, object: ObjectView) -> Array:
    """The object is there in this episode."""
    return object.present

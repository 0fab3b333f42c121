"""Terms of the task: a reward and a predicate."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math.pose import norm
from anysim.task.scene import Frame, SceneView


def approach_speed(scene: SceneView, *, tool: Frame, goal: Frame) -> Array:
    """(n,) speed of the tool towards the goal [m/s]; negative where it moves away."""
    offset = goal.position - tool.position
    direction = offset / np.maximum(norm(offset), 1e-9)[:, None]
    return (tool.twist[:, :3] * direction).sum(axis=1)


def inside(
    scene: SceneView, *, tool: Frame, goal: Frame, radius: Annotated[float, Field(gt=0, description="[m]")] = 0.02
) -> Array:
    """(n,) bool: the tool is in the ball of `radius` about the goal."""
    return norm(goal.position - tool.position) <= radius


TERMS = {"reward": {"approach_speed": approach_speed}, "predicate": {"inside": inside}}

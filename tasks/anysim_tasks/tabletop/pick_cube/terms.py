"""Terms of this task that no other needs."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math.pose import norm
from anysim.task.contract import at_most
from anysim.task.scene import Frame, ObjectView, SceneView


@at_most(1.0)
def lifted_toward(
    scene: SceneView, *, object: ObjectView, goal: Frame, scale: Annotated[float, Field(gt=0, description="[m]")] = 0.3
) -> Array:
    """1 - tanh(distance of the object to the goal / scale), counted only while the object moves with the goal's height.

    The share of the goal's height that is reached multiplies it, so that pushing along the table earns nothing.
    """
    position = object.root.position
    rest = object.nominal_pose[:, 2]
    risen = (position[:, 2] - rest) / np.maximum(goal.position[:, 2] - rest, 1e-6)
    share = np.minimum(np.maximum(risen, 0.0), 1.0)
    return share * (1.0 - np.tanh(norm(goal.position - position) / scale))


TERMS = {"reward": {"lifted_toward": lifted_toward}}

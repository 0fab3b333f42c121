"""Terms of this task that no other needs."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math.pose import norm
from anysim.task.contract import at_most
from anysim.task.scene import Frame, ObjectView, SceneView


@at_most(1.0)
def stacking(
    scene: SceneView,
    *,
    object: ObjectView,
    base: Frame,
    height: Annotated[float, Field(gt=0, description="between the origins in a stack [m]")],
    scale: Annotated[float, Field(gt=0, description="[m]")] = 0.2,
) -> Array:
    """1 - tanh(distance of the object to its place on the base / scale)."""
    place = base.position + np.array([0.0, 0.0, height])
    return 1.0 - np.tanh(norm(object.root.position - place) / scale)


TERMS = {"reward": {"stacking": stacking}}

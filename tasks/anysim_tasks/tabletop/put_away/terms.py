"""Terms of this task that no other needs."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math.pose import norm
from anysim.task.contract import at_most
from anysim.task.joints import RangedJointView
from anysim.task.scene import Frame, ObjectView, SceneView


@at_most(1.0)
def stowed(
    scene: SceneView,
    *,
    object: ObjectView,
    drawer: RangedJointView,
    inside: Frame,
    radius: Annotated[float, Field(gt=0, description="so near the floor it is in the drawer [m]")] = 0.12,
) -> Array:
    """How far a drawer is closed once the object is in it, half of how far it is open before."""
    there = norm(object.root.position - inside.position) < radius
    opening = np.minimum(np.maximum(drawer.opening, 0.0), 1.0)
    return np.where(there, 1.0 - 0.5 * opening, 0.5 * opening)


TERMS = {"reward": {"stowed": stowed}}

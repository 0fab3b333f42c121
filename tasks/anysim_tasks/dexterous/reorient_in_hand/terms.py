"""Terms of this task that no other needs."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.task.contract import at_most
from anysim.task.scene import Frame, SceneView
from anysim.task.terms.combinations import Turned


@at_most(1.0)
def spin(
    scene: SceneView, *, frame: Frame, rate: Annotated[float, Field(gt=0, description="[rad/s] that counts as 1")] = 2.0
) -> Array:
    """How fast a frame turns about the world's z axis, counter-clockwise, as a share of `rate`: within [-1, 1]."""
    del scene
    return np.clip(frame.twist[:, 5] / rate, -1.0, 1.0)


@at_most(1.0)
class TurnedShare(Turned):
    """How far a frame has turned about one of its axes since the first step, as a share of `angle`, up to 1.

    Turns the other way count less than nothing.
    """

    def __call__(self) -> Array:
        return np.minimum(self._update(self._turn)[:, 4] / self._angle, 1.0)


TERMS = {"reward": {"spin": spin, "turned_share": TurnedShare}}

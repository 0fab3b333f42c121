"""A latch: a joint that another one locks."""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.task.contract import changes_nothing_seen
from anysim.task.joints import JointView
from anysim.task.scene import SceneView

Draw = Callable[..., Array]


@changes_nothing_seen
class Latch:
    """A joint cannot move while it is where a bolt catches it, until another joint draws the bolt back.

    The bolt is dry friction that the joint has in place of its own. It is drawn back while `by` is at `position` or
    beyond, on the side of zero where that is.
    """

    goes_on = 0

    def __init__(
        self,
        scene: SceneView,
        *,
        joint: JointView,
        by: JointView,
        position: Annotated[float, Field(description="of `by` [rad, m]")],
        at: Annotated[float, Field(description="where the bolt catches the joint [rad, m]")] = 0.0,
        tolerance: Annotated[float, Field(gt=0, description="about that place [rad, m]")] = 0.02,
        friction: Annotated[float, Field(gt=0, description="of the bolt [N m, N]")] = 500.0,
    ) -> None:
        if len(joint.found) > 1:
            raise TaskError(f"'{joint.name}' stands for {len(joint.found)} joints; a latch holds one")
        self._scene, self._joint, self._by, self._position = scene, joint, by, position
        self._at, self._tolerance, self._friction = at, tolerance, friction
        self._index, self._own = [scene.index.joint(joint.name)], scene.memory()  # the friction without the bolt

    def __call__(self, draw: Draw) -> None:
        engine, ids = self._scene.engine, self._scene.env_ids
        now = engine.get_parameters("joint.friction", ids, self._index)
        nominal = self._joint.found[0].friction

        def own(before: Array, first: Array) -> Array:
            return np.where(first[:, None], np.where(now == self._friction, nominal, now), before)

        drawn_back = self._by.position * np.sign(self._position) >= abs(self._position)
        caught = ~drawn_back & (np.abs(self._joint.position - self._at) <= self._tolerance)
        wanted = np.where(caught[:, None], self._friction, self._own(own))
        if (wanted != now).any():
            engine.set_parameters("joint.friction", wanted, ids, self._index)

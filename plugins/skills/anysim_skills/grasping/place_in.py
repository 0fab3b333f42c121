"""Place in: put a held object down in a container, over whose rim it is lowered until something holds it up."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView, RobotView
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.grasping.place import Place
from anysim_skills.object_shapes import ObjectShapes


class PlaceIn(Place):
    """Put the held `object` down in the container `target`, over whose origin it is lowered, and let go of it.

    It comes over the rim, and down until it touches, or the hand touches the rim. What counts is that its origin then
    lies within the bounds of the container.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        target: ObjectView,
        tool: str = "tool",
        solver: str = "numba_ik",
        above: Annotated[float, Field(gt=0, description="[m] over the rim on the way there")] = 0.04,
        speed: Speed = 0.4,
        lower_speed: Speed = 0.06,
        retreat: Metres = 0.15,
        steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 200,
    ) -> None:
        self._inside, self._container = ObjectShapes(env.scene, target), target
        arm = {"robot": robot, "object": object, "tool": tool, "solver": solver, "above": above, "speed": speed}
        super().__init__(env, **arm, target=target.root, lower_speed=lower_speed, retreat=retreat, steps=steps)  # pyright: ignore[reportArgumentType]

    def measure(self, ids: Array, at: Array) -> None:
        super().measure(ids, at)
        low, high = self._inside.box(ids)
        self.deep[ids] = (high - low)[:, 2]

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        thing, into = self.object.root.position[at], self._container.root.pose[at]
        seen = P.rotate_inverse(into[:, 3:], thing - into[:, :3])
        low, high = self._inside.box(env_ids)
        return np.where(((seen >= low) & (seen <= high)).all(axis=1), GO_ON, _LOST)


_LOST = OUTCOMES.index(Outcome.LOST)

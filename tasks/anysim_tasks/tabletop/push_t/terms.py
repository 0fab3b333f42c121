"""Terms of this task that no other needs."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.model.world import Box
from anysim.task.contract import at_most
from anysim.task.scene import Frame, ObjectView, SceneView

GRID = 0.0025
"""[m] between the points at which outlines are compared, at most."""


class Overlap:
    """The share of an object's outline that is where it would be at the goal, seen from above.

    The outline is that of the boxes of the object, whose edges are along its own axes.

    Raises:
        TaskError: the object consists of more, which has no outline here.
    """

    def __init__(self, scene: SceneView, *, object: ObjectView, goal: Frame) -> None:
        self._object, self._goal = object, goal
        corners: list[tuple[Array, Array]] = []
        for shape, pose in scene.entity_shape(object.entity.name).shapes:
            if not isinstance(shape, Box) or np.abs(pose[3:6]).max() > 1e-6:
                raise TaskError(f"'{object.name}' is compared by its outline, and consists of more than upright boxes")
            half = np.array(shape.half_size)[:2]
            corners.append((pose[:2] - half, pose[:2] + half))
        self._corners = corners
        self._points = np.concatenate([_grid(low, high) for low, high in corners])

    def __call__(self) -> Array:
        seen = P.compose(P.inverse(self._object.root.pose), self._goal.pose)
        axes = [P.rotate(seen[:, 3:], np.eye(3)[axis])[:, :2] for axis in range(2)]
        x, y = (np.stack(axes, axis=2) @ self._points.T + seen[:, :2, None]).transpose(1, 0, 2)
        inside = np.zeros(x.shape, dtype=bool)
        for low, high in self._corners:
            inside |= (low[0] <= x) & (x <= high[0]) & (low[1] <= y) & (y <= high[1])
        return inside.mean(axis=1)


def _grid(low: Array, high: Array) -> Array:
    """Points (K, 2) in the middles of equal cells of a rectangle."""
    counts = np.ceil((high - low) / GRID - 1e-9).astype(int)
    sides = [a + (b - a) * (np.arange(n) + 0.5) / n for a, b, n in zip(low, high, counts, strict=True)]
    return np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)


@at_most(1.0)
class OverlapReward(Overlap):
    """The share of an object's outline that is where it would be at the goal, seen from above."""


class Overlaps(Overlap):
    """At least `share` of an object's outline is where it would be at the goal, seen from above."""

    def __init__(
        self, scene: SceneView, *, object: ObjectView, goal: Frame, share: Annotated[float, Field(gt=0, le=1)] = 0.9
    ) -> None:
        super().__init__(scene, object=object, goal=goal)
        self._share = share

    def __call__(self) -> Array:
        return super().__call__() >= self._share


TERMS = {"reward": {"overlap": OverlapReward}, "predicate": {"overlaps": Overlaps}}

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


class Footprint:
    """The outline of an object of upright boxes on the ground, as points of its own frame.

    Raises:
        TaskError: the object has other solids, which have no outline here.
    """

    def __init__(self, scene: SceneView, thing: ObjectView) -> None:
        shapes = scene.entity_shape(thing.entity.name).shapes
        if any(not isinstance(placed.shape, Box) or abs(placed.pose[3:5]).max() > 1e-6 for placed in shapes):
            raise TaskError(f"'{thing.name}' is compared by its outline, and consists of more than upright boxes")
        self._boxes = [(placed.pose, np.array(placed.shape.half_size)) for placed in shapes]  # pyright: ignore
        grids = [self._grid(pose, half) for pose, half in self._boxes]
        self.points = np.concatenate(grids)
        """(K, 3) [m], at height 0."""

    @staticmethod
    def _grid(pose: Array, half: Array) -> Array:
        counts = [int(np.ceil(2 * size / GRID - 1e-9)) for size in half[:2]]
        sides = [size * ((2 * np.arange(count) + 1) / count - 1) for size, count in zip(half, counts, strict=False)]
        x, y = (side.ravel() for side in np.meshgrid(*sides, indexing="ij"))
        return np.broadcast_to(pose[:3], (len(x), 3)) * [1, 1, 0] + P.rotate(
            np.broadcast_to(pose[3:], (len(x), 4)), np.stack([x, y, np.zeros_like(x)], axis=1)
        )

    def holds(self, points: Array) -> Array:
        """(...) bool: whether points (..., 3) of the object's frame are in the outline."""
        inside = np.zeros(points.shape[:-1], dtype=bool)
        for pose, half in self._boxes:
            local = P.rotate_inverse(np.broadcast_to(pose[3:], (*points.shape[:-1], 4)), points - pose[:3])
            inside |= (np.abs(local[..., :2]) <= half[:2]).all(axis=-1)
        return inside


class Overlap:
    """The share of an object's outline that is where it would be at the goal, seen from above."""

    def __init__(self, scene: SceneView, *, object: ObjectView, goal: Frame) -> None:
        self._object, self._goal = object, goal
        self._outline = Footprint(scene, object)

    def __call__(self) -> Array:
        thing, goal = self._object.root.pose, self._goal.pose
        points = np.broadcast_to(self._outline.points, (len(thing), *self._outline.points.shape))
        there = goal[:, None, :3] + P.rotate(np.broadcast_to(goal[:, None, 3:], (*points.shape[:2], 4)), points)
        turn = np.broadcast_to(thing[:, None, 3:], (*points.shape[:2], 4))
        return self._outline.holds(P.rotate_inverse(turn, there - thing[:, None, :3])).mean(axis=1)


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

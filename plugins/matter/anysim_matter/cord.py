"""A rope as skills and terms see it: points by how far along it they are, and how it goes around posts."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.families.base import FamilyState
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.task.scene import Frame, SceneView
from anysim.task.slot_frames import CategoryView
from anysim_skills.arm import Arm

Along = Annotated[float, Field(ge=0, le=1, description="a point of the rope: 0 is its start, 1 its end")]


class Cord:
    """A rope in the envs that a scene looks at, n of them."""

    def __init__(self, scene: SceneView, category: CategoryView) -> None:
        """Raises TaskError where it is no rope."""
        self._scene, self.name = scene, category.name
        if scene.families is None or scene.families.points(self.name) is None:
            raise TaskError(f"'{self.name}' is no family of matter; name a rope of world.families")
        fields = scene.families.state(self.name, np.array([0])).fields
        if "along" not in fields:
            raise TaskError(f"'{self.name}' is no rope: its points have no place along it")
        self._along = fields["along"][0] / fields["along"][0, -1]

    def state(self) -> FamilyState:
        """What it looks like now."""
        assert self._scene.families is not None
        return self._scene.families.state(self.name, self._scene.env_ids)

    def nearest(self, along: float) -> int:
        """The number of the point nearest to a place along it."""
        return int(np.argmin(np.abs(self._along - along)))

    def point(self, number: int) -> Array:
        """(n, 3) [m]."""
        return self.state().points[:, number]

    def held_near(self, places: Array, within: float = 0.06) -> Array:
        """(n,) bool: a pad holds it at a point within so much [m] of places (n, 3)."""
        state = self.state()
        near = P.norm(state.points - places[:, None]) < within
        return np.logical_or.reduce(near & state.fields["held"], axis=1)

    def kept(self, arm: Arm, at: Array, said: Array) -> Array:
        """(n,) what a phase says in rows of the scene where the arm's hand holds it; else an unstable grasp."""
        return np.where(self.held_near(arm.tool.position)[at], said, _UNSTABLE)

    def around(self, post: Frame) -> tuple[Array, Array]:
        """(n,) [rad] by which it goes around the axis z of a frame, left positive; (n,) [m] how near to it it comes."""
        points = self.state().points
        turn = np.broadcast_to(post.quaternion[:, None], (*points.shape[:2], 4))
        seen = P.rotate_inverse(turn, points - post.position[:, None])[..., :2]
        a, b = seen[:, :-1], seen[:, 1:]
        step = np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(axis=-1))
        way = b - a
        share = np.clip(-(a * way).sum(axis=-1) / np.maximum((way * way).sum(axis=-1), 1e-12), 0.0, 1.0)
        return step.sum(axis=1), P.norm(a + share[..., None] * way).min(axis=1)


_UNSTABLE = OUTCOMES.index(Outcome.UNSTABLE_GRASP)

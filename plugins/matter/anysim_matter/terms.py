"""Terms that measure how a rope lies: `matter.around`, `matter.end_at` and others."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.contract import at_most
from anysim.task.scene import Frame, SceneView
from anysim.task.slot_frames import CategoryView
from anysim_matter.cord import Along, Cord

Distance = Annotated[float, Field(gt=0, description="[m]")]


class Points:
    """Places (3 numbers each) of points of a rope [m]."""

    def __init__(
        self,
        scene: SceneView,
        *,
        category: CategoryView,
        at: Annotated[tuple[Along, ...], Field(min_length=1, description="points of the rope")],
    ) -> None:
        self._cord = Cord(scene, category)
        self._numbers = [self._cord.nearest(along) for along in at]

    def __call__(self) -> Array:
        places = self._cord.state().points[:, self._numbers]
        return places.reshape(len(places), -1)


class Around:
    """A rope goes around the axis z of b, from its start to its end, by such an angle, and comes near to it.

    Left, counter-clockwise as seen against z, is positive; a rope that passes straight by has some pi, or -pi.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        category: CategoryView,
        b: Frame,
        angle: Annotated[float, Field(description="that it goes around at least, to that side [rad]")],
        within: Annotated[float, Field(gt=0, description="of the axis, its nearest point [m]")] = 0.06,
    ) -> None:
        self._cord, self._post, self._angle, self._within = Cord(scene, category), b, angle, within

    def __call__(self) -> Array:
        turn, near = self._cord.around(self._post)
        return (np.sign(self._angle) * turn >= abs(self._angle)) & (near <= self._within)


class PointAt:
    """A point of a rope is within a distance of a frame."""

    def __init__(
        self, scene: SceneView, *, category: CategoryView, b: Frame, at: Along = 1.0, within: Distance = 0.04
    ) -> None:
        self._cord, self._frame, self._within = Cord(scene, category), b, within
        self._number = self._cord.nearest(at)

    def distance(self) -> Array:
        """(n,) [m]."""
        return P.norm(self._cord.point(self._number) - self._frame.position)

    def __call__(self) -> Array:
        return self.distance() <= self._within


@at_most(1.0)
class PointNear(PointAt):
    """How near a point of a rope is to a frame, such as a hand or a goal: 1 - tanh(distance / scale)."""

    def __init__(
        self, scene: SceneView, *, category: CategoryView, b: Frame, at: Along = 1.0, scale: Distance = 0.2
    ) -> None:
        super().__init__(scene, category=category, b=b, at=at)
        self._scale = scale

    def __call__(self) -> Array:
        return 1.0 - np.tanh(self.distance() / self._scale)


class LetGo:
    """No pad holds a rope."""

    def __init__(self, scene: SceneView, *, category: CategoryView) -> None:
        self._cord = Cord(scene, category)

    def __call__(self) -> Array:
        return ~np.logical_or.reduce(self._cord.state().fields["held"], axis=1)


class Below:
    """A point of a rope is lower than a height [m]: it has fallen off."""

    def __init__(
        self, scene: SceneView, *, category: CategoryView, height: Annotated[float, Field(description="world [m]")]
    ) -> None:
        self._cord, self._height = Cord(scene, category), height

    def __call__(self) -> Array:
        return self._cord.state().points[..., 2].min(axis=1) < self._height


TERMS = {
    "observation": {"points": Points},
    "reward": {"point_near": PointNear},
    "predicate": {"around": Around, "below": Below, "let_go": LetGo, "point_at": PointAt},
}

"""Terms that measure how a garment lies: `garments.spread_out`, `garments.folded`, `garments.hung` and others."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.contract import at_most
from anysim.task.scene import Frame, SceneView
from anysim.task.slot_frames import CategoryView
from anysim_garments.cloth import Cloth, Spot, covered

Distance = Annotated[float, Field(gt=0, description="[m]")]
Spots = Annotated[tuple[Spot, ...], Field(min_length=1, description="points of the garment")]
Pairs = Annotated[
    tuple[tuple[Spot, Spot], ...], Field(min_length=1, description="points of the garment that are to lie together")
]


class Points:
    """Places (3 numbers each) of points of a garment [m]."""

    def __init__(self, scene: SceneView, *, category: CategoryView, at: Spots) -> None:
        self._cloth = Cloth(scene, category)
        self._numbers = self._cloth.nearest(at)

    def __call__(self) -> Array:
        places = self._cloth.state().points[:, self._numbers]
        return places.reshape(len(places), -1)


@at_most(1.0)
class CoveredShare:
    """Share of its flat area that a garment covers, seen from above."""

    def __init__(self, scene: SceneView, *, category: CategoryView) -> None:
        self._cloth = Cloth(scene, category)

    def __call__(self) -> Array:
        return np.minimum(covered(self._cloth.state().points, self._cloth.faces) / self._cloth.area, 1.0)


class SpreadOut(CoveredShare):
    """A garment covers such a share of its flat area, seen from above."""

    def __init__(
        self,
        scene: SceneView,
        *,
        category: CategoryView,
        share: Annotated[float, Field(gt=0, le=1, description="of the area that it covers when it lies flat")] = 0.85,
    ) -> None:
        super().__init__(scene, category=category)
        self._share = share

    def __call__(self) -> Array:
        return super().__call__() >= self._share


class Gap:
    """Distances [m] between points of a garment that are to lie together."""

    def __init__(self, scene: SceneView, *, category: CategoryView, pairs: Pairs) -> None:
        self._cloth = Cloth(scene, category)
        self._one = self._cloth.nearest([pair[0] for pair in pairs])
        self._two = self._cloth.nearest([pair[1] for pair in pairs])

    def gaps(self) -> Array:
        """(n, p)."""
        points = self._cloth.state().points
        return P.norm(points[:, self._one] - points[:, self._two])


@at_most(1.0)
class PairsNear(Gap):
    """How near points of a garment are to those on which they are to lie: 1 - tanh(mean distance / scale)."""

    def __init__(self, scene: SceneView, *, category: CategoryView, pairs: Pairs, scale: Distance = 0.2) -> None:
        super().__init__(scene, category=category, pairs=pairs)
        self._scale = scale

    def __call__(self) -> Array:
        return 1.0 - np.tanh(self.gaps().mean(axis=1) / self._scale)


class FoldedPairs(Gap):
    """Pairs of points of a garment lie together, and it lies low: its highest point is not far above its lowest."""

    def __init__(
        self,
        scene: SceneView,
        *,
        category: CategoryView,
        pairs: Pairs,
        mean: Distance = 0.04,
        most: Distance = 0.08,
        thickness: Distance = 0.06,
    ) -> None:
        """`mean` and `most` are of the pairs' distances."""
        super().__init__(scene, category=category, pairs=pairs)
        self._mean, self._most, self._thickness = mean, most, thickness

    def __call__(self) -> Array:
        gaps, height = self.gaps(), np.ptp(self._cloth.state().points[..., 2], axis=1)
        return (gaps.mean(axis=1) <= self._mean) & (gaps.max(axis=1) <= self._most) & (height <= self._thickness)


class Hung:
    """A garment hangs over a rail along the axis x of b: all of it so high, and its middle so near to the rail."""

    def __init__(
        self,
        scene: SceneView,
        *,
        category: CategoryView,
        b: Frame,
        height: Annotated[float, Field(description="above which all of it is, world [m]")],
        within: Annotated[float, Field(gt=0, description="of the upright plane through the rail [m]")] = 0.05,
    ) -> None:
        self._cloth, self._rail, self._height, self._within = Cloth(scene, category), b, height, within

    def __call__(self) -> Array:
        points = self._cloth.state().points
        middle = P.rotate_inverse(self._rail.quaternion, points.mean(axis=1) - self._rail.position)
        return (points[..., 2].min(axis=1) > self._height) & (np.abs(middle[:, 1]) <= self._within)


@at_most(1.0)
class MiddleNear:
    """How near the middle of a garment is to a frame: 1 - tanh(distance / scale)."""

    def __init__(self, scene: SceneView, *, category: CategoryView, b: Frame, scale: Distance = 0.2) -> None:
        self._cloth, self._frame, self._scale = Cloth(scene, category), b, scale

    def __call__(self) -> Array:
        middle = self._cloth.state().points.mean(axis=1)
        return 1.0 - np.tanh(P.norm(middle - self._frame.position) / self._scale)


@at_most(1.0)
class PointNear:
    """How near a frame, such as a hand, is to a point of a garment: 1 - tanh(distance / scale)."""

    def __init__(self, scene: SceneView, *, category: CategoryView, at: Spot, a: Frame, scale: Distance = 0.2) -> None:
        self._cloth, self._frame, self._scale = Cloth(scene, category), a, scale
        self._number = int(self._cloth.nearest([at])[0])

    def __call__(self) -> Array:
        place = self._cloth.state().points[:, self._number]
        return 1.0 - np.tanh(P.norm(place - self._frame.position) / self._scale)


class LetGo:
    """No pad holds a garment."""

    def __init__(self, scene: SceneView, *, category: CategoryView) -> None:
        self._cloth = Cloth(scene, category)

    def __call__(self) -> Array:
        return ~np.logical_or.reduce(self._cloth.state().fields["held"], axis=1)


class Below:
    """The middle of a garment is lower than a height [m]: it has fallen off."""

    def __init__(
        self, scene: SceneView, *, category: CategoryView, height: Annotated[float, Field(description="world [m]")]
    ) -> None:
        self._cloth, self._height = Cloth(scene, category), height

    def __call__(self) -> Array:
        return self._cloth.state().points[..., 2].mean(axis=1) < self._height


TERMS = {
    "observation": {"points": Points},
    "reward": {"covered": CoveredShare, "middle_near": MiddleNear, "pairs_near": PairsNear, "point_near": PointNear},
    "predicate": {"below": Below, "folded": FoldedPairs, "hung": Hung, "let_go": LetGo, "spread_out": SpreadOut},
}

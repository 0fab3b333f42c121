"""Regions: parts of the plane in which things may go."""

from typing import ClassVar

from pydantic import Field, model_validator

from anysim_schemas.base import Name, Number, Positive, Spec
from anysim_schemas.errors import KeyFault

Vec2 = tuple[Number, Number]


class CircleSpec(Spec):
    """A disc."""

    center: Vec2 = Field(default=(0.0, 0.0), description="x, y [m]")
    radius: Positive = Field(description="radius [m]")


class RegionSpec(Spec):
    """A part of the plane: a rectangle, a circle or a polygon, seen from above.

    It holds the frame origin of what is placed; that the whole of it stays on its support is seen to in any case.
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("rectangle",), ("circle",), ("polygon",))

    rectangle: tuple[Vec2, Vec2] | None = Field(default=None, description="the lowest and the highest corner, x, y [m]")
    circle: CircleSpec | None = Field(default=None, description="a disc")
    polygon: tuple[Vec2, ...] | None = Field(
        default=None, description="corners x, y [m], in order along the edge; it may bend inwards"
    )
    of: Name | None = Field(
        default=None, description="an object whose frame the numbers are in; that of the world where not given"
    )

    @model_validator(mode="after")
    def _one_shape(self) -> "RegionSpec":
        shapes = [key for (key,) in self.alternatives if getattr(self, key) is not None]
        if len(shapes) != 1:
            raise ValueError(
                f"expected exactly one of rectangle, circle, polygon; got {' and '.join(shapes) or 'none'}"
            )
        if self.rectangle is not None:
            low, high = self.rectangle
            if low[0] >= high[0] or low[1] >= high[1]:
                raise KeyFault(f"the lowest corner {low} must be below the highest {high}, in x and in y", "rectangle")
        if self.polygon is not None:
            if len(self.polygon) < 3:
                raise KeyFault(f"a polygon has at least three corners, got {len(self.polygon)}", "polygon")
            if _crosses_itself(self.polygon):
                raise KeyFault("the edges of the polygon cross; give its corners in order along the edge", "polygon")
        return self


def _crosses_itself(corners: tuple[Vec2, ...]) -> bool:
    """Whether two edges that are no neighbours meet, or the polygon has no area."""
    n = len(corners)
    edges = [(corners[i], corners[(i + 1) % n]) for i in range(n)]
    area = sum(a[0] * b[1] - b[0] * a[1] for a, b in edges)
    if area == 0:
        return True
    return any(_cross(*edges[i], *edges[j]) for i in range(n) for j in range(i + 2, n) if not (i == 0 and j == n - 1))


def _cross(a: Vec2, b: Vec2, c: Vec2, d: Vec2) -> bool:
    def side(p: Vec2, q: Vec2, r: Vec2) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return side(a, b, c) * side(a, b, d) <= 0 and side(c, d, a) * side(c, d, b) <= 0

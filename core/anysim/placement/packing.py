"""Packing: things in rows, each into the first corner that the others leave.

Corners are where the box of one thing ends and its neighbour's may begin, and those of the area itself (the corner
points of bottom-left packing). They are tried from the lowest y on, then the lowest x.
"""

from collections.abc import Callable, Sequence

from anysim.geometry import polygon as G
from anysim.geometry.convex_parts import PlacedPart, PlacedSolid, Pose
from anysim.placement.candidate import Candidate
from anysim.placement.sampler import PlacementSampler

GAP = 2e-4
"""[m] left between neighbours that may stand as close as they like."""

MOST = 4000
"""Corners that are tried for one thing."""


def packed(
    turns: Sequence[tuple[Candidate, PlacementSampler]],
    objected: Callable[[Candidate], bool],
    standing: Sequence[PlacedSolid],
    gap: float = GAP,
) -> Candidate | None:
    """The first corner at which one of `turns` can stand; None where there is none.

    `turns` are candidates with the orientations that are allowed, each anywhere in the area of its origin; `objected`
    says whether one is in the way of something.
    """
    for start, sampler in turns:
        area = start.area
        assert area is not None
        for x, y in _corners(start, area, standing, gap)[:MOST]:
            moved = shifted(start, x - start.pose.position[0], y - start.pose.position[1])
            if not objected(moved):
                sampler.keep()
                return moved
    return None


def _corners(start: Candidate, area: G.Area, standing: Sequence[PlacedSolid], gap: float) -> list[G.Point]:
    """Origins of the thing for which its box begins where the area does, or where another's box ends."""
    low, high = start.placed.low, start.placed.high
    left, front = start.pose.position[0] - low[0], start.pose.position[1] - low[1]
    (x0, y0), (x1, y1) = G.bounds(area)
    level = [s for s in standing if s.low[2] < high[2] and s.high[2] > low[2] + 1e-6]
    inside = [
        b
        for b in level
        if b.high[0] + left >= x0 and b.low[0] - left <= x1 and b.high[1] + front >= y0 and b.low[1] - front <= y1
    ]
    xs = sorted({x0, *(b.high[0] + gap + left for b in inside)})
    ys = sorted({y0, *(b.high[1] + gap + front for b in inside)})
    return [(x, y) for y in ys if y <= y1 for x in xs if x <= x1 and G.holds(area, x, y)]


def shifted(found: Candidate, dx: float, dy: float, dz: float = 0.0) -> Candidate:
    """The same thing elsewhere."""

    def there(p: tuple[float, float, float]) -> tuple[float, float, float]:
        return p[0] + dx, p[1] + dy, p[2] + dz

    pose = Pose(there(found.pose.position), found.pose.rotation)
    parts = tuple(
        PlacedPart(p.part, Pose(there(p.pose.position), p.pose.rotation), there(p.low), there(p.high))
        for p in found.placed.parts
    )
    placed = PlacedSolid(found.placed.name, pose, parts, there(found.placed.low), there(found.placed.high))
    return found._replace(pose=pose, placed=placed)

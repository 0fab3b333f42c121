"""How much room there is left on surfaces."""

from collections.abc import Mapping, Sequence

from anysim.geometry import polygon as G
from anysim.placement.constraints import Settled
from anysim.placement.standing_areas import Footing


def free_area(footings: Sequence[Footing], settled: Mapping[str, Settled]) -> tuple[float, float]:
    """[m^2] of surfaces, and of what has no box of anything else over it, counted on a grid of 32 by 32 points."""
    whole = free = 0.0
    for footing in footings:
        own = footing.owner.name
        level = footing.height
        boxes = [
            s.placed
            for s in settled.values()
            if s.placed.name != own and s.placed.low[2] < level + 0.02 and s.placed.high[2] > level
        ]
        (x0, y0), (x1, y1) = G.bounds(footing.area)
        points = [
            (x0 + (i + 0.5) / 32 * (x1 - x0), y0 + (j + 0.5) / 32 * (y1 - y0)) for i in range(32) for j in range(32)
        ]
        inside = [p for p in points if G.holds(footing.area, *p)]
        bare = [
            p for p in inside if not any(b.low[0] <= p[0] <= b.high[0] and b.low[1] <= p[1] <= b.high[1] for b in boxes)
        ]
        size = G.total(footing.area)
        whole, free = whole + size, free + size * len(bare) / max(1, len(inside))
    return whole, free

"""A proposer of layouts: what stands on something stands there in a row."""

from typing import Any

from anysim.placement.proposals import Request

GAP = 0.02
"""[m] between neighbours."""


def in_a_row(request: Request) -> dict[str, Any]:
    """Poses by name, along y from the edge of what things are `on`; the episode's seed says which is the first."""
    surfaces = {surface.name.partition(".")[0]: surface for surface in request.supports}
    things = [thing for thing in request.things if thing.layout.get("on") in surfaces]
    first = request.seed % max(len(things), 1)
    edge = {name: max(y for _, y in surface.outline) for name, surface in surfaces.items()}
    poses: dict[str, Any] = {}
    for thing in things[first:] + things[:first]:
        surface = surfaces[thing.layout["on"]]
        x = sum(x for x, _ in surface.outline) / len(surface.outline)
        y = edge[thing.layout["on"]] - GAP - thing.size[1] / 2
        poses[thing.name] = {"position": [x, y, surface.height + thing.bottom]}
        edge[thing.layout["on"]] = y - thing.size[1] / 2
    return {"poses": poses, "reason": "beside each other, from left to right"}

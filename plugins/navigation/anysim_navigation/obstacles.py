"""Level ground: what stands on it, as outlines from above, and what of it is left to a disc."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.model.world import World
from anysim_assets.rooms.occupancy import footprints
from anysim_navigation.agent import Agent

CORNERS = 16
"""Of the polygon around a disc, by which outlines grow."""
AROUND = 1.0
"""[m] of ground around all that stands on it, where no area is given."""


def outlines_of(world: World, body_pose: Array, present: Array, agent: Agent, without: Sequence[str]) -> list[Array]:
    """Convex polygons (K, 2) [m] around the geoms that an agent can neither get over nor under.

    Args:
        world: the neutral model, its ground at height 0.
        body_pose: (B, 7) of one env.
        present: (E,) bool, the entities that are there.
        agent: what is to get past.
        without: entities that do not count, such as the agent itself and what moves by itself.
    """
    gone = [e for e, entity in enumerate(world.entities) if entity.name in without or not present[e]]
    ignored = {b for e in gone for b in range(world.entities[e].body_start, world.entities[e].body_stop)}
    return footprints(world, body_pose, (agent.step, agent.height), ignored)


def area_around(outlines: Sequence[Array], agent: Agent) -> Array:
    """(4, 2) [m] the rectangle about all outlines, and about the origin."""
    points = np.concatenate([np.zeros((1, 2)), *outlines])
    room = AROUND + 2 * agent.radius
    (x0, y0), (x1, y1) = points.min(axis=0) - room, points.max(axis=0) + room
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def free_ground(outlines: Sequence[Array], area: Array, agent: Agent) -> Any:
    """The polygons where the middle of the agent may be: within `area` (K, 2), off all outlines by the radius.

    A circle is a polygon around it, so nothing comes nearer than the radius, and up to 2 % of it is given away.
    """
    import shapely

    return shapely.Polygon(area).difference(grown(outlines, agent.radius))


def grown(outlines: Sequence[Array], radius: float) -> Any:
    """What is nearer to one of the convex outlines (K, 2) than a radius [m], and a little more.

    By sums of their corners with those of a polygon around the disc, which are exact: `buffer` of GEOS simplifies
    first, and was up to 1.4 % of the radius too near.
    """
    import shapely

    turn = 2 * np.pi * (np.arange(CORNERS) + 0.5) / CORNERS  # exact along the axes
    ring = radius / np.cos(np.pi / CORNERS) * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    sums = [shapely.MultiPoint((outline[:, None] + ring).reshape(-1, 2)).convex_hull for outline in outlines]
    return shapely.union_all(sums)

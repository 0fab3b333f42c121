"""Shapes of robots as navigation sees them: discs that cover a base, and the height that it needs."""

from math import inf

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import World
from anysim_assets.rooms.occupancy import footprints
from anysim_navigation.agent import Agent
from anysim_navigation.limits import BaseLimits, discs_over

STEP = 0.03
"""[m] what is lower is driven over, and not counted as part of the robot either."""
OVER = 0.05
"""[m] that stays free above a robot."""
LEAST_HEIGHT = 0.3


def discs_of(world: World, robot: str, frame_pose: Array, least: int = 1, sway: float = 0.0) -> Array:
    """(D, 3) discs over a robot as it begins, its frame at a pose (7,), in that frame, and `sway` [m] to its sides."""
    outline, aside = outline_of(world, robot, frame_pose), np.array([0.0, sway])
    return discs_over(np.concatenate([outline - aside, outline + aside]), least)


def outline_of(world: World, entity: str, frame_pose: Array, top: float = inf) -> Array:
    """(K, 2) [m] points around what of an entity, as it begins, is below a height: around all of it if nothing is.

    They are in its frame at a pose (7,), and that alone where nothing of it collides.
    """
    found = world.entities[world.entity_numbers[entity]]
    others = {-1, *range(found.body_start), *range(found.body_stop, len(world.bodies))}
    band = (footprints(world, world.initial_body_pose, heights, others) for heights in ((STEP, top), (-inf, inf)))
    outlines = np.concatenate(next((each for each in band if each), [frame_pose[None, :2]]))
    off = np.concatenate([outlines - frame_pose[:2], np.zeros((len(outlines), 1))], axis=1)
    half = 0.5 * P.yaw(frame_pose[3:])
    level = np.array([0.0, 0.0, np.sin(half), np.cos(half)])
    return P.rotate_inverse(np.tile(level, (len(off), 1)), off)[:, :2]


def agent_of(world: World, robot: str, limits: BaseLimits) -> Agent:
    """What gets where the robot gets: by its largest disc and its height."""
    from anysim.geometry.bounds import EntityShape

    entity = world.entities[world.entity_numbers[robot]]
    top = float(EntityShape(world, robot).bounds(world.initial_body_pose[entity.root])[1][2])
    return Agent(limits.radius, max(LEAST_HEIGHT, top + OVER), STEP)

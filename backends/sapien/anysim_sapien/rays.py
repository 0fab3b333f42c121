"""Rays against the collision shapes of the scenes."""

from collections.abc import Sequence

import numpy as np

from anysim.conventions import Array
from anysim.engine.state import RayHits
from anysim_sapien.layout import Layout
from anysim_sapien.scene import EnvScene

REACH = 1e6
"""[m]: PhysX wants a longest distance."""


def cast(scenes: Sequence[EnvScene], layout: Layout, origins: Array, directions: Array, ids: Array) -> RayHits:
    """First hits of rays (E, R, 3) with unit directions."""
    distance = np.full(origins.shape[:2], np.inf)
    entity = np.full(origins.shape[:2], -1)
    for row, env in enumerate(ids):
        scene = scenes[env]
        for column in range(origins.shape[1]):
            hit = scene.system.raycast(origins[row, column], directions[row, column], REACH)
            if hit is not None:
                distance[row, column] = hit.distance
                entity[row, column] = layout.body_entity[scene.body_of[hit.component]]
    return RayHits(distance, entity)

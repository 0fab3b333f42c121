"""Boxes around things in the axes of their roots, links where they are now: from shapes and poses, not from pixels."""

from collections.abc import Collection
from functools import cached_property

import numpy as np

from anysim.conventions import Array
from anysim.geometry.bounds import shape_bounds
from anysim.math import pose as P
from anysim.model.shapes import is_ground
from anysim.model.world import World

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
"""(8, 3) of a box of unit size about the origin."""


class ThingBounds:
    """The visible shapes of the entities of a World; of one without any, those that collide."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._meshes = {mesh.name: mesh for mesh in world.meshes}

    @cached_property
    def _shapes(self) -> list[list[int]]:
        world, found = self._world, list[list[int]]()
        for entity in world.entities:
            own = [g for b in range(entity.body_start, entity.body_stop) for g in world.body_geoms[b]]
            own = [g for g in own if not is_ground(world.geoms[g].shape)]
            found.append([g for g in own if world.geoms[g].visible] or own)
        return found

    def box(self, entity: int, body_pose: Array, bodies: Collection[int] | None = None) -> tuple[Array, Array] | None:
        """Pose (7,) and size (3,) [m] of the box with bodies at poses (B, 7), world frame; None without shapes.

        `bodies` are those that count, all of the entity if not given; the axes are those of its root.
        """
        world = self._world
        root = body_pose[world.entities[entity].root]
        lows, highs = list[Array](), list[Array]()
        for number in self._shapes[entity]:
            geom = world.geoms[number]
            if bodies is not None and geom.body not in bodies:
                continue
            own = P.compose(P.inverse(root), body_pose[geom.body]) if geom.body >= 0 else P.inverse(root)
            place = P.compose(own, P.pose(geom.position, geom.quaternion))
            low, high = shape_bounds(geom.shape, place, self._meshes)
            lows.append(low)
            highs.append(high)
        if not lows:
            return None
        low, high = np.min(lows, axis=0), np.max(highs, axis=0)
        middle = root[:3] + P.rotate(root[3:], (low + high) / 2)
        return P.pose(middle, root[3:]), high - low


def corners(pose: Array, size: Array) -> Array:
    """The corners (8, 3) [m] of a box, world frame."""
    return pose[:3] + P.rotate(np.broadcast_to(pose[3:], (8, 4)), CORNERS * size)

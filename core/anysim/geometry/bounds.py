"""Bounds of shapes and entities, with which a layout sets things onto each other without an engine.

All functions are batched over leading axes of the poses, row by row the same whatever the batch.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.errors import NameLookupError, listing, suggest
from anysim.math import pose as P
from anysim.model.forward_kinematics import joint_pose
from anysim.model.shapes import is_ground
from anysim.model.world import Box, Capsule, Cylinder, Geom, Mesh, MeshShape, Shape, Sphere, World


def shape_bounds(shape: Shape, pose: Array, meshes: Mapping[str, Mesh]) -> tuple[Array, Array]:
    """The lowest and highest corner (..., 3) of the axis-aligned box around a shape at poses (..., 7), exact.

    Planes and height fields have no bounds of their own (ValueError); see `ground_top`.
    """
    centre, quaternion = pose[..., :3], pose[..., 3:]
    if isinstance(shape, MeshShape):
        corners = centre[..., None, :] + P.rotate(quaternion[..., None, :], meshes[shape.mesh].vertices)
        return corners.min(axis=-2), corners.max(axis=-2)
    axes = np.abs(P.to_matrix(quaternion))  # (..., 3, 3), columns are the shape's axes
    match shape:
        case Box((x, y, z)):
            reach = axes[..., 0] * x + axes[..., 1] * y + axes[..., 2] * z
        case Sphere(radius):
            reach = np.full(centre.shape, radius)
        case Capsule(radius, half_length):
            reach = axes[..., 2] * half_length + radius
        case Cylinder(radius, half_length):
            reach = axes[..., 2] * half_length + radius * np.sqrt(np.maximum(0.0, 1.0 - axes[..., 2] ** 2))
        case _:
            raise ValueError(f"a {type(shape).__name__} has no bounds")
    return centre - reach, centre + reach


class PlacedShape(NamedTuple):
    """A shape with its pose (7,) in the root frame of its entity."""

    shape: Shape
    pose: Array


class EntityShape:
    """The collision geometry of an entity as one rigid thing: its joints at their initial positions.

    An entity that collides with nothing is represented by what is seen of it. Made once, asked often.
    """

    def __init__(self, world: World, name: str) -> None:
        number = world.entity_numbers.get(name)
        if number is None:
            names = [e.name for e in world.entities]
            raise NameLookupError(f"there is no entity '{name}'{suggest(name, names)} (entities: {listing(names)})")
        self.name, entity = name, world.entities[number]
        self._meshes = {mesh.name: mesh for mesh in world.meshes}
        start, stop = entity.body_start, entity.body_stop
        poses = {start: np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])}
        root = world.bodies[start]
        for i in range(start + 1, stop):
            if world.bodies[i].parent == WORLD:  # an instancer has many roots; they are one thing where they start
                place = P.pose(world.bodies[i].position, world.bodies[i].quaternion)
                poses[i] = P.compose(P.inverse(P.pose(root.position, root.quaternion)), place)
                continue
            body, joint = world.bodies[i], world.body_joint[i]
            rest = P.compose(poses[body.parent], P.pose(body.position, body.quaternion))
            poses[i] = P.compose(rest, joint_pose(world, joint, np.array(world.joints[joint].initial)))
        own = sorted(index for body in range(start, stop) for index in world.body_geoms[body])
        shown = [g for g in (world.geoms[index] for index in own) if not is_ground(g.shape)]
        chosen: list[Geom] = [g for g in shown if g.collides] or shown
        self.collides = any(g.collides for g in shown)
        self.owned = tuple(
            (PlacedShape(g.shape, P.compose(poses[g.body], P.pose(g.position, g.quaternion))), g.body) for g in chosen
        )
        """The shapes with the bodies that they are fixed to."""
        self.shapes = tuple(shape for shape, _ in self.owned)

    def bounds(self, root_pose: Array) -> tuple[Array, Array]:
        """Lowest and highest corner (..., 3) [m] around the entity with its root at poses (..., 7)."""
        if not self.shapes:
            return root_pose[..., :3].copy(), root_pose[..., :3].copy()
        lows: list[Array] = []
        highs: list[Array] = []
        for shape, poses in self._alike:
            roots = np.broadcast_to(root_pose[..., None, :], (*root_pose.shape[:-1], *poses.shape))
            low, high = shape_bounds(shape, P.compose(roots, np.broadcast_to(poses, roots.shape)), self._meshes)
            lows.append(low.min(axis=-2))
            highs.append(high.max(axis=-2))
        return np.min(lows, axis=0), np.max(highs, axis=0)

    @cached_property
    def _alike(self) -> list[tuple[Shape, Array]]:
        """Equal shapes together, with their poses (S, 7): an instancer has hundreds."""
        places: dict[Shape, list[Array]] = {}
        for placed in self.shapes:
            places.setdefault(placed.shape, []).append(placed.pose)
        return [(shape, np.stack(poses)) for shape, poses in places.items()]

    def top_height(self, root_pose: Array) -> Array:
        """World height (...) [m] of the highest point, root at poses (..., 7)."""
        return self.bounds(root_pose)[1][..., 2]

    @cached_property
    def radius(self) -> float:
        """Radius [m] of a ball around the root's origin that holds the box around the entity in any orientation."""
        low, high = self.bounds(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
        return float(np.sqrt((np.maximum(np.abs(low), np.abs(high)) ** 2).sum()))


def ground_top(world: World, low: Array, high: Array) -> Array:
    """The greatest height (...) [m] of the ground under rectangles from `low` to `high` (..., 2); 0 without ground."""
    return np.nan_to_num(world.ground.top(low, high), nan=0.0)

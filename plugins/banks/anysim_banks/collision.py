"""The collision filter: whether the open gripper is inside of what it is put around, or of what stands beside it.

Bounding balls first, for all grasps at once; exact convex queries by Coal for the boxes and pieces that are near.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import Box, Capsule, Cylinder, Sphere
from anysim_banks.gripper import Gripper
from anysim_banks.pieces import Piece, bounding_radius

MARGIN = 1e-4
"""[m] from which on things count as touching."""


class CollisionFilter:
    """Which grasps an open gripper can be put into; `pieces` are all that is there, in the body's frame."""

    def __init__(self, gripper: Gripper, pieces: Sequence[Piece]) -> None:
        import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

        self._coal: Any = coal
        self._boxes, half = gripper.boxes
        self._reach = np.linalg.norm(half, axis=1)
        self._shapes = [coal.Box(*(2 * h).tolist()) for h in half]
        self._pieces = [(_geometry(coal, piece), self._transform(piece.pose)) for piece in pieces]
        self._middle = np.array([piece.pose[:3] for piece in pieces]).reshape(-1, 3)
        self._radius = np.array([bounding_radius(piece) for piece in pieces])

    def free(self, pose: Array) -> Array:
        """(n,) bool: of tool poses (n, 7), those in which the open gripper touches nothing."""
        coal = self._coal
        request, result = coal.CollisionRequest(), coal.CollisionResult()
        request.security_margin = MARGIN
        placed = P.compose(pose[:, None, :], self._boxes[None])
        apart = np.linalg.norm(placed[:, :, None, :3] - self._middle, axis=-1)
        near = apart < self._reach[None, :, None] + self._radius + MARGIN
        turn = P.to_matrix(placed[..., 3:])
        free = np.ones(len(pose), dtype=bool)
        at = (-1, -1)
        where: Any = None
        for row, box, number in zip(*(index.tolist() for index in np.nonzero(near)), strict=True):
            if not free[row]:
                continue
            if at != (row, box):
                at, where = (row, box), coal.Transform3s(turn[row, box], placed[row, box, :3])
            geometry, there = self._pieces[number]
            result.clear()
            if coal.collide(self._shapes[box], where, geometry, there, request, result):
                free[row] = False
        return free

    def _transform(self, pose: Array) -> Any:
        return self._coal.Transform3s(P.to_matrix(pose[3:]), pose[:3])


def _geometry(coal: Any, piece: Piece) -> Any:
    match piece.shape:
        case Box((x, y, z)):
            return coal.Box(2 * x, 2 * y, 2 * z)
        case Sphere(radius):
            return coal.Sphere(radius)
        case Capsule(radius, half):
            return coal.Capsule(radius, 2 * half)
        case Cylinder(radius, half):
            return coal.Cylinder(radius, 2 * half)
        case _:
            assert piece.hull is not None  # of a mesh; pieces have no other shapes
            corners, numbers = np.unique(piece.hull.corners.reshape(-1, 3), axis=0, return_inverse=True)
            points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
            for corner in corners:
                points.append(corner)
            for a, b, c in numbers.reshape(-1, 3).tolist():
                faces.append(coal.Triangle(a, b, c))
            return coal.Convex(points, faces)

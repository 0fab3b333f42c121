"""The collision filter: whether the gripper, from open to almost closed, is inside of what is there.

Bounding balls first, for all grasps at once; exact convex queries by Coal for the boxes and pieces that are near.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.geometry.coal_solids import coal_hull, coal_solid
from anysim.math import pose as P
from anysim_banks.gripper import SPARE, Gripper
from anysim_banks.pieces import Piece, bounding_radius

MARGIN = 1e-4
"""[m] from which on things count as touching."""


class CollisionFilter:
    """Which grasps an open gripper can be put into; `pieces` are all that is there, in the body's frame."""

    def __init__(self, gripper: Gripper, pieces: Sequence[Piece]) -> None:
        import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

        self._coal: Any = coal
        self._boxes, self._half = gripper.boxes
        self._side = np.where(np.abs(self._boxes[:, 1]) > 1e-9, np.sign(self._boxes[:, 1]), 0.0)
        self._stroke = gripper.stroke
        self._pieces = [(geometry_of(piece), self._transform(piece.pose)) for piece in pieces]
        self._middle = np.array([piece.pose[:3] for piece in pieces]).reshape(-1, 3)
        self._radius = np.array([bounding_radius(piece) for piece in pieces])

    def free(self, pose: Array, width: Array) -> Array:
        """(n,) bool: of tool poses (n, 7), those in which the gripper touches nothing.

        It is open, and its fingers may close until they are `SPARE` further apart than `width` (n,) [m].
        """
        coal = self._coal
        request, result = coal.CollisionRequest(), coal.CollisionResult()
        request.security_margin = MARGIN
        half, boxes = self._swept(width)
        placed = P.compose(pose[:, None, :], boxes)
        apart = np.linalg.norm(placed[:, :, None, :3] - self._middle, axis=-1)
        near = apart < np.linalg.norm(half, axis=-1)[..., None] + self._radius + MARGIN
        turn = P.to_matrix(placed[..., 3:])
        free = np.ones(len(pose), dtype=bool)
        at = (-1, -1)
        where: Any = None
        shape: Any = None
        for row, box, number in zip(*(index.tolist() for index in np.nonzero(near)), strict=True):
            if not free[row]:
                continue
            if at != (row, box):
                at, where = (row, box), coal.Transform3s(turn[row, box], placed[row, box, :3])
                shape = coal.Box(*(2 * half[row, box]).tolist())
            geometry, there = self._pieces[number]
            result.clear()
            if coal.collide(shape, where, geometry, there, request, result):
                free[row] = False
        return free

    def _swept(self, width: Array) -> tuple[Array, Array]:
        """Half sizes (n, K, 3) and poses (n, K, 7) of what the parts sweep: fingers slide along y."""
        way = 0.5 * np.maximum(self._stroke - width - SPARE, 0.0)[:, None] * np.abs(self._side)
        half = np.tile(self._half, (len(width), 1, 1))
        boxes = np.tile(self._boxes, (len(width), 1, 1))
        half[..., 1] += 0.5 * way
        boxes[..., 1] -= 0.5 * way * self._side
        return half, boxes

    def _transform(self, pose: Array) -> Any:
        return self._coal.Transform3s(P.to_matrix(pose[3:]), pose[:3])


def geometry_of(piece: Piece) -> Any:
    """A piece as Coal has it, in its own frame."""
    if (solid := coal_solid(piece.shape)) is not None:
        return solid
    assert piece.hull is not None  # of a mesh; pieces have no other shapes
    return coal_hull(piece.hull.corners.reshape(-1, 3))

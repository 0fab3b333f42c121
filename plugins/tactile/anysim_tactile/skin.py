"""The skin: a surface of taxels with a stiffness, and what it makes of a force on it."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim_tactile.surfaces import Surface

SAME = 1e-2
"""Motions that press taxels by less than this part of the largest count as none: friction has what is along them."""


class Load(NamedTuple):
    """How taxels carry a force.

    Attributes:
        motion: (N, q) of what touches, in the coordinates of `Skin.levers`.
        deep: (N, T) [m] how far each gives way.
        force: (N, T, 3) [N] on each.
        total: (N, 6) the sum of the forces and that of their moments about the origin. It has all of the force, and of
            the moment what they can carry without pulling.
    """

    motion: Array
    deep: Array
    force: Array
    total: Array


class Skin:
    """Taxels that yield along their normals, each by itself (Winkler's foundation)."""

    def __init__(self, surface: Surface, stiffness: float) -> None:
        """`stiffness` is the pressure over the depth [Pa/m]."""
        from anysim_tactile.kernels import indentation

        self._press, self._share = indentation.press, indentation.share
        self.surface, self.stiffness = surface, stiffness * surface.area
        self._middle = surface.points.mean(axis=0)
        self._size = float(np.linalg.norm(surface.points - self._middle, axis=1).max()) or surface.pitch
        _, sizes, motions = np.linalg.svd(self._screws(surface), full_matrices=False)
        self._motions = motions[sizes > SAME * sizes[0]]
        self._across = np.ascontiguousarray(self.levers(surface).T)

    def _screws(self, surface: Surface) -> Array:
        """(T, 6): how much a shift and a turn of what touches, about the middle, press each taxel."""
        inward = -surface.normals
        return np.concatenate([inward, P.cross(surface.points - self._middle, inward) / self._size], axis=1)

    def levers(self, surface: Surface) -> Array:
        """(T, q): the same, in the coordinates of those motions that taxels can tell apart; also of finer surfaces."""
        return np.ascontiguousarray(self._screws(surface) @ self._motions.T)

    def carry(self, gap: Array, pushes: Array, wrench: Array) -> Load:
        """How taxels with gaps (N, T) [m] carry wrenches (N, 6), force and moment about the origin.

        `pushes` (N, 6) is the part of them along normals of the skin, which decides how deep it gives way.
        """
        envs, taxels = gap.shape
        straight, moment = pushes[:, :3], pushes[:, 3:] - P.cross(self._middle, pushes[:, :3])
        strong = P.norm(straight)
        along = np.divide(straight, strong[:, None], out=np.zeros_like(straight), where=strong[:, None] > 0)
        wanted = _times(np.concatenate([straight, moment / self._size], axis=1), self._motions)
        motion, deep = np.empty_like(wanted), np.empty_like(gap)
        self._press(
            np.ascontiguousarray(gap),
            self._across,
            self.stiffness,
            wanted,
            _times(along, self._motions[:, :3]),
            strong,
            motion,
            deep,
        )
        push, force, total = deep * self.stiffness, np.empty((envs, taxels, 3)), np.empty((envs, 6))
        if (lonely := (push.sum(axis=1) <= 0) & wrench.any(axis=1)).any():  # nothing gives way: the nearest carries it
            nearest = np.where(lonely, gap.argmin(axis=1), 0)
            push[lonely, nearest[lonely]] = np.finfo(float).tiny ** 0.5
        self._share(push, self.surface.points, self.surface.normals, wrench, force, total)
        return Load(motion, deep, force, total)


def _times(rows: Array, matrix: Array) -> Array:
    """(N, q) the products of rows (N, k) with those of a matrix (q, k); each row's bits do not depend on the others."""
    return np.ascontiguousarray(np.add.reduce(rows[:, :, None] * matrix.T[None], axis=1))

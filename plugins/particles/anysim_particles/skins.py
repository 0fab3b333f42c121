"""Skins: closed surfaces of other matter that liquids meet, and what they trade with it.

A liquid takes the points of skins as bodies without a size, whose masses they have, while it moves on; what they get is
told to the family (`Skinned.touch`), which acts on it in its own next step.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from anysim.conventions import Array


class Skin(NamedTuple):
    """A closed skin of V points in an env.

    Attributes:
        points: (V, 3) [m].
        velocities: (V, 3) [m/s].
        mass: (V,) [kg] of them.
        faces: (F, 3) triangles, outward.
        radius: [m] of matter around the skin.
    """

    points: Array
    velocities: Array
    mass: Array
    faces: Array
    radius: float


@runtime_checkable
class Skinned(Protocol):
    """A family whose matter has a skin."""

    def skin(self, env: int) -> Skin:
        """What it is like in an env now."""
        ...

    def touch(self, env: int, impulse: Array) -> None:
        """Its points get impulses (V, 3) [N s], before its solver moves on the next time."""
        ...


class SkinTable(NamedTuple):
    """All skins of an env, for the kernels: V points and F faces in all.

    Attributes:
        points, velocities, mass: as those of `Skin`.
        face: (F, 3) int32 rows of points.
        begin: (S + 1,) int32 the first face of each skin.
        thick: (S,) [m] radii.
        counts: of points, by skin.
    """

    points: Array
    velocities: Array
    mass: Array
    face: Array
    begin: Array
    thick: Array
    counts: tuple[int, ...]


NOTHING = SkinTable(
    np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3), np.int32), np.zeros(1, np.int32), np.zeros(0), ()
)
"""No skins."""


def table(skins: Sequence[Skin]) -> SkinTable:
    """The skins of an env in one table."""
    if not skins:
        return NOTHING
    counts = tuple(len(one.points) for one in skins)
    starts = np.cumsum([0, *counts[:-1]])
    faces = [one.faces + start for one, start in zip(skins, starts, strict=True)]
    return SkinTable(
        np.concatenate([one.points for one in skins]),
        np.concatenate([one.velocities for one in skins]),
        np.concatenate([one.mass for one in skins]),
        np.concatenate(faces).astype(np.int32),
        np.cumsum([0, *(len(one) for one in faces)]).astype(np.int32),
        np.array([one.radius for one in skins], dtype=float),
        counts,
    )

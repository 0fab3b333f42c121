"""Surfaces of blocks in the solver of a garment that lies on them.

Their points are free there for a step, with the mass that is theirs, and are put back to where their block has them in
the next. What they got is told to the block, whose solver acts on it in its own next step.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

import mujoco
import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim_soft.flex_xml import numbers

NAME = "surface "
"""Of their flexes, before the number."""


def point_areas(points: Array, faces: Array) -> Array:
    """(V,) [m^2] of a surface of triangles (F, 3) that each of its points (V, 3) [m] stands for."""
    a, b = (points[faces[:, i]] - points[faces[:, 0]] for i in (1, 2))
    return np.bincount(faces.ravel(), np.repeat(P.norm(P.cross(a, b)) / 6, 3), len(points))


class Surface(NamedTuple):
    """A surface of S points, as it is in an episode.

    Attributes:
        rest: (S, 3) [m] in the frame of its block, where nothing deforms it.
        faces: (F, 3) triangles, outward.
        mass: (S,) [kg].
        radius: [m] of matter around it.
        friction: coefficient.
    """

    rest: Array
    faces: Array
    mass: Array
    radius: float
    friction: float

    def xml(self, number: int) -> str:
        """The flex, which meets the garment alone."""
        faces = " ".join(map(str, self.faces.ravel().tolist()))
        return (
            f'<flexcomp name="{NAME}{number}" type="direct" dim="2" point="{numbers(self.rest.ravel())}" '
            f'element="{faces}" radius="{self.radius!r}" mass="1">'
            f'<contact selfcollide="none" contype="1" conaffinity="0" friction="{self.friction!r}"/>'
            f'<edge equality="true"/></flexcomp>'
        )


@runtime_checkable
class Surfaced(Protocol):
    """A family whose matter has such a surface."""

    def surface(self, env: int) -> Surface:
        """What it is like in the episode of an env."""
        ...

    def moving(self, env: int) -> tuple[Array, Array]:
        """(S, 3) [m], [m/s] its points now."""
        ...

    def touch(self, env: int, impulse: Array) -> None:
        """Its points get impulses (S, 3) [N s], before its solver moves on the next time."""
        ...


class Surfaces:
    """Those in a model, after the flex of the garment itself.

    Attributes:
        impulses: (S, 3) [N s] what the points of each got since they were put.
    """

    def __init__(self, model: mujoco.MjModel, count: int) -> None:
        begins, ends = model.flex_vertadr[1 : count + 1], model.flex_vertadr + model.flex_vertnum
        bodies = [model.flex_vertbodyid[begin:end] for begin, end in zip(begins, ends[1:], strict=True)]
        self._rest = [np.array(model.body_pos[own]) for own in bodies]
        self._places = [model.jnt_qposadr[model.body_jntadr[own]][:, None] + np.arange(3) for own in bodies]
        self._dofs = [model.body_dofadr[own][:, None] + np.arange(3) for own in bodies]
        self.impulses = [np.zeros_like(rest) for rest in self._rest]

    def put(self, data: Any, moving: Sequence[tuple[Array, Array]]) -> None:
        """Put each to places and velocities (S, 3) of its points."""
        for number, (places, velocities) in enumerate(moving):
            data.qpos[self._places[number]] = places - self._rest[number]
            data.qvel[self._dofs[number]] = velocities
            self.impulses[number][:] = 0.0

    def account(self, data: Any, h: float) -> None:
        """Add what a step of `h` [s] gave."""
        for dofs, impulse in zip(self._dofs, self.impulses, strict=True):
            impulse += h * data.qfrc_constraint[dofs]


def loosen(spec: Any, model: mujoco.MjModel, surfaces: Sequence[Surface]) -> None:
    """Let points of surfaces go each by itself, with their mass, and no weight: in their block, that is borne."""
    for number, surface in enumerate(surfaces, 1):
        begin = model.flex_vertadr[number]
        for body, mass in zip(model.flex_vertbodyid[begin:], surface.mass, strict=False):
            element = spec.body(model.body(body).name)
            # none where the episode of its block is yet to begin
            element.mass, element.gravcomp = mass or 1.0, 1.0
    for element in spec.equalities:  # MuJoCo warns of a flex that has none
        element.active = element.active and not element.name1.startswith(NAME)

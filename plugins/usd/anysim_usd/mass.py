"""Masses and inertias of bodies: what UsdPhysics says of them, and what it leaves to the shapes that collide.

A mass that is not given is that of the shapes: their own masses, or their densities, which the shape or the next
prim above it says, up to the body, else its material, else 1000 kg/m^3. What else is not given of centre and inertia
is theirs as well.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from anysim.assets.model import ImportNote
from anysim.conventions import Array
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.world import Inertial, Mesh, MeshShape
from anysim_usd.looks import LookReader
from anysim_usd.numbers import authored, exact, exact_vector, given, quaternion, vector
from anysim_usd.shapes import ShapeReader
from anysim_usd.space import Space

WATER = 1000.0
"""[kg/m^3] The density of what says none, as UsdPhysics has it."""


class MassReader:
    """Reads the inertials of bodies, in their own frames."""

    def __init__(self, space: Space, shapes: ShapeReader, looks: LookReader, notes: list[ImportNote]) -> None:
        self._space, self._shapes, self._looks, self._notes = space, shapes, looks, notes

    def of(self, prim: Any, name: str, frame: Array, colliders: Sequence[Any]) -> Inertial:
        """The inertial of a body whose frame is (7,), before it is judged; without mass where nothing gives it one."""
        kilograms, metres = self._space.kilograms, self._space.metres
        mass = given(prim, "physics:mass") or given(prim, "anysim:mass") or 0.0
        mass = exact(prim, "mass", mass) if mass > 0 else 0.0
        center, tensor = self._center(prim, frame), self._tensor(prim)
        if mass > 0 and center is not None and tensor is not None:
            own = inertia.make(mass * kilograms, center, inertia.matrices(tensor) * kilograms * metres**2)
            return own
        parts = [part for one in colliders if (part := self._part(one, prim, frame)) is not None]
        whole = inertia.composed(parts)
        if not parts or whole.mass <= 0:
            if mass <= 0:
                return Inertial(0.0)
            matrix = np.zeros((3, 3)) if tensor is None else inertia.matrices(tensor) * kilograms * metres**2
            return inertia.make(mass * kilograms, np.zeros(3) if center is None else center, matrix)
        total = mass * kilograms if mass > 0 else whole.mass
        if mass <= 0:
            self._notes.append(
                ImportNote(
                    "info", f"body '{name}'", f"says no mass; that of its shapes is {total:.4g} kg, of their density"
                )
            )
        matrix = inertia.tensor(inertia.scaled(whole, total / whole.mass))
        if tensor is not None:
            matrix = inertia.matrices(tensor) * kilograms * metres**2
        return inertia.make(total, np.array(whole.com) if center is None else center, matrix)

    def _center(self, prim: Any, frame: Array) -> Array | None:
        """The centre [m] that a body says, in its frame (7,)."""
        found = vector(prim, "physics:centerOfMass", (-np.inf,) * 3)
        if not np.isfinite(found).all() or not authored(prim, "physics:centerOfMass"):
            return None
        local = exact_vector(prim, "centerOfMass", found, least=1e-3)
        return P.rotate_inverse(frame[3:], self._space.of(prim).point(local * self._space.metres) - frame[:3])

    def _tensor(self, prim: Any) -> Array | None:
        """The tensor (6,) that a body says, in units of the file; None where it says none."""
        moments = vector(prim, "physics:diagonalInertia", (0.0, 0.0, 0.0))
        if not moments.any() or not np.isfinite(moments).all():
            return None
        rough = inertia.from_principal(moments, quaternion(prim, "physics:principalAxes"))
        return exact_vector(prim, "inertia", rough)

    def _part(self, prim: Any, body: Any, frame: Array) -> Inertial | None:
        """What a shape that collides adds to a body."""
        solid = self._shapes.solid(prim)
        if solid is None:
            return None
        meshes: dict[str, Mesh] = {}
        if solid.shape is not None:
            shape, pose = solid.shape, P.compose(P.inverse(frame), solid.pose)
        else:
            shape, pose = MeshShape("mesh"), P.inverse(frame)
            assert solid.vertices is not None
            assert solid.faces is not None
            meshes["mesh"] = Mesh("mesh", solid.vertices, solid.faces)
        volume = abs(inertia.volume(shape, meshes))
        if volume <= 0:
            return None
        mass = given(prim, "physics:mass") if prim != body else None
        if mass:
            total = mass * self._space.kilograms
        else:
            total = volume * self._density(prim, body) * self._space.kilograms / self._space.metres**3
        if isinstance(shape, MeshShape) and inertia.volume(shape, meshes) < 0:
            mesh = meshes["mesh"]
            meshes["mesh"] = Mesh("mesh", mesh.vertices, mesh.faces[:, ::-1])
        return inertia.moved(inertia.of_shape(shape, total, meshes), pose)

    def _density(self, prim: Any, body: Any) -> float:
        """The density of a shape, in units of the file: the nearest that is said from it up to its body.

        Its material's is the weakest, but for that of water.
        """
        here = prim
        while here and not here.IsPseudoRoot():
            if found := given(here, "physics:density"):
                return found
            if here == body:
                break
            here = here.GetParent()
        if found := self._looks.density(prim):
            return found
        return WATER * self._space.unit**3 / self._space.weight

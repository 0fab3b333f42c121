"""Masses and inertias: of shapes and rigidly joined bodies, their principal axes, and the repair of impossible ones.

Validity is judged on the second moments S = tr(I)/2 - I, which are the mass integrals of r r^T: a mass distribution
exists exactly where S is positive semidefinite, and that is the same as I being positive with the triangle inequality.
"""

from collections.abc import Mapping, Sequence
from math import pi
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import AssetError, EngineError
from anysim.math import matrix as M, pose as P
from anysim.model.hash import tidy
from anysim.model.shapes import solid_moments
from anysim.model.world import Box, Capsule, Cylinder, Inertial, Mesh, MeshShape, Shape, Sphere

BALL_RADIUS = 0.01  # [m] of the solid ball that stands for a body with mass and without any inertia
VIRTUAL_SHARE = 1e-3
"""The share of a body's mass and inertia that a link without any of its own gets, where a joint needs one: nothing
beside the body, and enough for single precision where axes of a chain fall into line."""
_PLACES = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
_SMALLEST = 1e-5  # [m] radius of gyration: below, an inertia is a placeholder for none
_FLOOR = 1e-6  # smallest second moment of a moving body, relative to their sum: engines reject exact equality
_NOISE = 1e-12


def tensor(inertial: Inertial) -> Array:
    """The inertia about the centre of mass as a matrix (3, 3), body axes."""
    return matrices(np.array(inertial.inertia))


def matrices(moments: Array) -> Array:
    """(..., 3, 3) of moments (..., 6) in the order xx, yy, zz, xy, xz, yz."""
    return moments[..., _PLACES]


def turned(moments: Array, quaternion: Array) -> Array:
    """Matrices (..., 3, 3) of moments (..., 6) of bodies that are turned by quaternions (..., 4)."""
    turn = P.to_matrix(quaternion)
    return M.product(turn, matrices(moments), np.swapaxes(turn, -1, -2))


def make(mass: float, com: Array, matrix: Array) -> Inertial:
    """An Inertial from arrays; what is only rounding noise becomes zero, so that hashes do not depend on it."""
    if not (np.isfinite(mass) and np.isfinite(matrix).all()):
        raise AssetError(f"a body with a mass of {mass:.3g} kg and an inertia that is not finite; check its sizes")
    noise = _NOISE * max(float(np.trace(matrix)), 0.0)
    moments = (matrix[0, 0], matrix[1, 1], matrix[2, 2], matrix[0, 1], matrix[0, 2], matrix[1, 2])
    xx, yy, zz, xy, xz, yz = (float(m) if abs(m) > noise else 0.0 for m in moments)
    return Inertial(float(mass), tidy(com), (xx, yy, zz, xy, xz, yz))


def moved(inertial: Inertial, pose: Array) -> Inertial:
    """The same body seen from a frame in which its own has the pose (7,)."""
    rotation = P.to_matrix(pose[3:])
    com = pose[:3] + P.rotate(pose[3:], np.array(inertial.com))
    return make(inertial.mass, com, M.product(rotation, tensor(inertial), rotation.T))


def composed(parts: Sequence[Inertial]) -> Inertial:
    """Bodies of one frame as one rigid body (parallel axes, exact)."""
    mass = sum(part.mass for part in parts)
    if len(parts) == 1 or mass <= 0:
        return parts[0] if len(parts) == 1 else Inertial(0.0)
    com = sum((part.mass * np.array(part.com) for part in parts), np.zeros(3)) / mass
    total = np.zeros((3, 3))
    for part in parts:
        d = np.array(part.com) - com
        total += tensor(part) + part.mass * (P.dot(d, d) * np.eye(3) - np.outer(d, d))
    return make(mass, com, total)


def repaired(inertial: Inertial) -> tuple[Inertial, str | None]:
    """The nearest inertial that a body can have, and what was changed; None where nothing was.

    Negative second moments are set to zero (the nearest positive semidefinite matrix in the Frobenius norm). A body
    with mass and no inertia at all, or one of a body thinner than a hundredth of a millimetre, becomes a solid ball of
    `BALL_RADIUS`.
    """
    if inertial.mass <= 0:
        return Inertial(0.0), None if not any(inertial.inertia) else "has inertia and no mass; the inertia is dropped"
    moments, axes = M.eigen(_second_moments(tensor(inertial)))
    total = float(moments.sum())
    if total <= 0 or pointlike(inertial):
        value = 0.4 * inertial.mass * BALL_RADIUS**2
        had = "no inertia" if total <= 0 else f"an inertia of {2 * total / 3:.2g} kg m^2, which is none"
        return (
            Inertial(inertial.mass, inertial.com, (value, value, value, 0.0, 0.0, 0.0)),
            f"has a mass of {inertial.mass:g} kg and {had}; taken as a ball of {BALL_RADIUS * 100:g} cm radius",
        )
    if moments[0] >= -_NOISE * total:
        return inertial, None
    clipped = M.product(axes * np.maximum(moments, 0.0), axes.T)
    fixed = make(inertial.mass, np.array(inertial.com), np.trace(clipped) * np.eye(3) - clipped)
    change = float(np.linalg.norm(tensor(fixed) - tensor(inertial)) / np.linalg.norm(tensor(inertial)))
    return fixed, f"has an inertia that no body can have; the nearest possible one differs by {100 * change:.2g} %"


def pointlike(inertial: Inertial) -> bool:
    """Whether the inertia is none, or one of nothing that has a size; good enough for a part of a body."""
    return float(np.abs(tensor(inertial)).max()) < inertial.mass * _SMALLEST**2


def moving(inertial: Inertial) -> Inertial:
    """An inertial that engines accept for a moving body: every second moment at least `_FLOOR` of their sum."""
    moments, axes = M.eigen(_second_moments(tensor(inertial)))
    floor = _FLOOR * float(moments.sum())
    if moments[0] >= floor:
        return inertial
    raised = M.product(axes * np.maximum(moments, floor), axes.T)
    return make(inertial.mass, np.array(inertial.com), np.trace(raised) * np.eye(3) - raised)


def _second_moments(matrix: Array) -> Array:
    return 0.5 * np.trace(matrix) * np.eye(3) - matrix


def scaled(inertial: Inertial, factor: float) -> Inertial:
    """The same body with `factor` times the mass."""
    return make(inertial.mass * factor, np.array(inertial.com), tensor(inertial) * factor)


def volume(shape: Shape, meshes: Mapping[str, Mesh]) -> float:
    """[m^3]; 0 for shapes without one (planes, height fields)."""
    match shape:
        case Box((x, y, z)):
            return 8 * x * y * z
        case Sphere(r):
            return 4 / 3 * pi * r**3
        case Cylinder(r, h):
            return pi * r * r * 2 * h
        case Capsule(r, h):
            return pi * r * r * 2 * h + 4 / 3 * pi * r**3
        case MeshShape(name):
            return _solid(meshes[name])[0]
        case _:
            return 0.0


def of_shape(shape: Shape, mass: float, meshes: Mapping[str, Mesh]) -> Inertial:
    """The inertial of a homogeneous solid of this shape, in the shape's frame; a mesh counts as its closed surface.

    Raises:
        ValueError: the shape has no volume.
    """
    if isinstance(shape, MeshShape):
        size, com, inertia = _solid(meshes[shape.mesh])
        if size <= 0:
            raise ValueError(f"the mesh '{shape.mesh}' encloses no volume")
        return make(mass, com, inertia * (mass / size))
    return Inertial(mass, (0.0, 0.0, 0.0), (*solid_moments(shape, mass), 0.0, 0.0, 0.0))


class Principal(NamedTuple):
    """Principal moments (3,) [kg m^2] and the orientation (4,) xyzw of their axes in the body."""

    moments: Array
    frame: Array


def principal(moments: Sequence[float] | Array, *, descending: bool = False) -> Principal:
    """The principal axes of a tensor (xx, yy, zz, xy, xz, yz) [kg m^2].

    A diagonal tensor keeps its axes. Otherwise the moments ascend (or descend) and the axes are right-handed, the first
    two with their largest component positive, so that equal tensors give equal bits.
    """
    xx, yy, zz, xy, xz, yz = (float(v) for v in moments)
    if xy == 0.0 and xz == 0.0 and yz == 0.0:
        return Principal(np.array([xx, yy, zz]), np.array([0.0, 0.0, 0.0, 1.0]))
    values, axes = M.eigen(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    if descending:
        values, axes = values[::-1].copy(), axes[:, ::-1].copy()
    for column in range(2):
        if axes[np.argmax(np.abs(axes[:, column])), column] < 0:
            axes[:, column] *= -1
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return Principal(values, P.from_matrix(axes))


def from_principal(moments: Array, frame: Array) -> Array:
    """Tensors (..., 6) of principal moments (..., 3) whose axes have the orientation (..., 4) xyzw."""
    axes = P.to_matrix(np.asarray(frame, dtype=float))
    moments = np.asarray(moments, dtype=float)
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    terms = [sum(axes[..., i, k] * moments[..., k] * axes[..., j, k] for k in range(3)) for i, j in pairs]
    return np.stack(terms, axis=-1)


def check_physical(name: str, moments: Array) -> None:
    """Raise EngineError unless the moments (3,) are those of a body with mass in space (positive, A + B >= C)."""
    low, middle, high = sorted(float(m) for m in moments)
    if low <= 0 or low + middle < high * (1 - 1e-9):
        raise EngineError(
            f"the inertia of body '{name}' belongs to no rigid body: its principal moments are {low:.4g}, {middle:.4g} "
            f"and {high:.4g} kg m^2; each must be positive and no larger than the sum of the other two"
        )


def _solid(mesh: Mesh) -> tuple[float, Array, Array]:
    """Volume, centroid and inertia about it at density 1 of a closed surface, summed over tetrahedra to the origin."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    six = (a * np.cross(b, c)).sum(axis=1)
    size = float(six.sum() / 6)
    if abs(size) < 1e-18:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    total = a + b + c
    com = (six[:, None] * total).sum(axis=0) / 24 / size
    outer = sum(np.einsum("f,fi,fj->ij", six, v, v) for v in (a, b, c, total)) / 120
    centred = outer - size * np.outer(com, com)
    return size, com, np.trace(centred) * np.eye(3) - centred

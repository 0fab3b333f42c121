"""The primitive around a mesh that adds the least volume: a box, a ball, a cylinder or a capsule."""

from collections.abc import Collection, Iterator
from math import sqrt

import numpy as np

from anysim.assets.meshes import WholeMesh
from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.hash import split
from anysim.model.world import Box, Capsule, Cylinder, Mesh, Shape, Sphere
from anysim_colliders.balls import least_ball
from anysim_colliders.replacing import Collider, Substitute, replaced, volume_words
from anysim_schemas.collision_shapes import CollisionShapesSpec

_EQUAL = 1e-6
"""Of two volumes that differ by less, as a share, the first is taken: rounding decides nothing."""


def as_primitives(model: ImportedModel, spec: CollisionShapesSpec, kept: Collection[str]) -> ImportedModel:
    """The model whose meshes collide as the primitives around them.

    Raises:
        AssetError: a mesh without an extent.
    """
    return replaced(model, kept, _made)


def _made(hull: Mesh, whole: WholeMesh) -> Substitute:
    found = primitive(np.asarray(whole.mesh().vertices), hull)
    volume = inertia.volume(found.shape, {})
    return Substitute((found,), f"a {type(found.shape).__name__.lower()}: {volume_words(volume, hull, whole)}")


def primitive(points: Array, hull: Mesh) -> Collider:
    """The primitive of least volume around points (V, 3) [m], along an axis of their hull: all points are inside.

    Raises:
        AssetError: the points are all in one plane.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        corners = points[np.sort(ConvexHull(points).vertices)]
    except QhullError as error:
        raise AssetError(f"mesh '{hull.name}' is flat, so there is no primitive around it") from error
    best, least = None, np.inf
    for shape, centre, axes in _candidates(corners, hull):
        volume = inertia.volume(shape, {})
        if volume < least * (1 - _EQUAL):
            best, least = (shape, centre, axes), volume
    assert best is not None  # there is always a ball
    shape, centre, axes = best
    position, quaternion = split(P.pose(tuple(centre.tolist()), P.from_matrix(axes)))
    return Collider(shape, position, quaternion)


def _candidates(corners: Array, hull: Mesh) -> Iterator[tuple[Shape, Array, Array]]:
    """Shapes with their centres (3,) and axes (3, 3), in columns, simple ones first."""
    frames = [_frame(axis) for axis in _axes(corners, hull)]
    yield from (_box(corners, frame) for frame in frames)
    for kind in (_cylinder, _capsule):
        yield from (kind(corners, frame) for frame in frames)
    centre, radius = least_ball(corners)
    yield Sphere(radius), centre, np.eye(3)


def _axes(corners: Array, hull: Mesh) -> list[Array]:
    """Directions (3,) that a primitive may have: z, x, y, the principal ones, the normals of the hull's faces."""
    _, _, principal = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)
    a, b, c = np.moveaxis(np.asarray(hull.vertices)[np.asarray(hull.faces)], 1, 0)
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    normals = normals[length > 0] / length[length > 0, None]
    found: list[Array] = []
    for axis in [*np.eye(3)[[2, 0, 1]], *principal, *normals]:
        if not any(abs(float(axis @ other)) > 1 - 1e-9 for other in found):
            found.append(axis if axis[np.argmax(np.abs(axis))] > 0 else -axis)
    return found


def _frame(axis: Array) -> Array:
    """A right-handed frame (3, 3), in columns, whose z is the axis."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = other - (other @ axis) * axis
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)


def _box(corners: Array, frame: Array) -> tuple[Shape, Array, Array]:
    """The least box whose z is the frame's: one of its sides is along an edge of the outline."""
    from scipy.spatial import ConvexHull

    flat = (corners @ frame)[:, :2]
    outline = flat[ConvexHull(flat).vertices]
    edges = np.roll(outline, -1, axis=0) - outline
    angles = [0.0, *(np.arctan2(edges[:, 1], edges[:, 0]) % (np.pi / 2)).tolist()]
    best, least = 0.0, np.inf
    for angle in angles:
        c, s = np.cos(angle), np.sin(angle)
        area = float(np.prod(np.ptp(outline @ np.array([[c, -s], [s, c]]), axis=0)))
        if area < least * (1 - _EQUAL):
            best, least = angle, area
    c, s = np.cos(best), np.sin(best)
    axes = np.stack([c * frame[:, 0] + s * frame[:, 1], -s * frame[:, 0] + c * frame[:, 1], frame[:, 2]], axis=1)
    local = corners @ axes
    low, high = local.min(axis=0), local.max(axis=0)
    x, y, z = ((high - low) / 2).tolist()
    return Box((x, y, z)), axes @ ((low + high) / 2), axes


def _cylinder(corners: Array, frame: Array) -> tuple[Shape, Array, Array]:
    local = corners @ frame
    middle, radius = least_ball(local[:, :2])
    low, high = float(local[:, 2].min()), float(local[:, 2].max())
    return Cylinder(radius, (high - low) / 2), frame @ np.array([*middle, (low + high) / 2]), frame


def _capsule(corners: Array, frame: Array) -> tuple[Shape, Array, Array]:
    """As wide as the cylinder, with the caps as near to each other as the corners let them be."""
    local = corners @ frame
    middle, radius = least_ball(local[:, :2])
    off = ((local[:, :2] - middle) ** 2).sum(axis=1)
    cap = np.sqrt(np.maximum(radius * radius - off, 0.0))
    high, low = float((local[:, 2] - cap).max()), float((local[:, 2] + cap).min())
    if high - low <= _EQUAL * radius:  # one ball holds all
        height = (high + low) / 2
        radius = sqrt(float((off + (local[:, 2] - height) ** 2).max()))
        return Sphere(radius), frame @ np.array([*middle, height]), np.eye(3)
    return Capsule(radius, (high - low) / 2), frame @ np.array([*middle, (low + high) / 2]), frame

"""Rotations and poses over arrays of any leading shape. Quaternions are xyzw; poses are `[position, quaternion]`.

Everything is written component by component: numpy rounds elementwise operations one by one, so a row's result is the
same bits whatever the batch around it (a matrix product through BLAS or einsum would not promise that).
"""

from collections.abc import Iterable
from typing import TypeVar

import numpy as np

from anysim.conventions import Array
from anysim.math import matrix as M

Angle = TypeVar("Angle", float, Array)

_LEFT, _RIGHT = np.array([1, 2, 0, 2, 0, 1]), np.array([2, 0, 1, 1, 2, 0])
"""A cross product is the first three products of these components of the factors less the last three."""
_INVERSE = np.array([-1.0, -1.0, -1.0, 1.0])
_FIRST = np.array([3, 0, 1, 2])
_SECOND = np.array([[0, 1, 2, 3], [3, 2, 1, 0], [2, 3, 0, 1], [1, 0, 3, 2]])
_SIGNS = np.array([[1.0, 1.0, 1.0, 1.0], [1.0, -1.0, 1.0, -1.0], [1.0, 1.0, -1.0, -1.0], [-1.0, 1.0, 1.0, -1.0]])
"""A quaternion product is the sum of four rows: the components `_FIRST` of the first factor times signed ones of the
second."""

_TURNS = 3 + np.array([*_LEFT, *_FIRST])
"""Of a pose: the components of its rotation that a cross product has on its left, and those of a product."""
_FEW = 512
"""Numbers up to which the calls take the time, and one call for all is best; beyond, it is the numbers."""


def _summed(terms: Array) -> Array:
    """The sum along the last axis, in index order."""
    if terms.size <= _FEW:
        return np.add.accumulate(terms, axis=-1)[..., -1]  # in order by its definition, as no other sum of numpy's is
    total = terms[..., 0]
    for i in range(1, terms.shape[-1]):
        total = total + terms[..., i]
    return total


def multiply(a: Array, b: Array) -> Array:
    """Quaternion product a*b: the rotation b first, then a. Shapes (..., 4)."""
    if a.size + b.size <= _FEW:
        rows = a.take(_FIRST, axis=-1)[..., None] * (b.take(_SECOND, axis=-1) * _SIGNS)
        return np.add.accumulate(rows, axis=-2)[..., -1, :]
    product = a[..., 3:4] * b
    for component in (0, 1, 2):
        turned = b.take(_SECOND[component + 1], axis=-1) * _SIGNS[component + 1]
        product = product + a[..., component : component + 1] * turned
    return product


def conjugate(q: Array) -> Array:
    """The inverse of a unit quaternion. Shape (..., 4)."""
    return q * _INVERSE


def normalize(q: Array) -> Array:
    """Unit length. Shape (..., 4)."""
    return q / norm(q)[..., None]


def norm(v: Array) -> Array:
    """Euclidean length along the last axis, summed in index order."""
    return np.sqrt(_summed(v * v))


def dot(a: Array, b: Array) -> Array:
    """Inner product along the last axis, summed in index order."""
    return _summed(a * b)


def _components(a: Array, b: Array) -> tuple[Array, Array]:
    """Both with their axes reversed, so that a component is one block of memory once it was taken."""
    missing = a.ndim - b.ndim
    if missing > 0:
        b = b.reshape((1,) * missing + b.shape)
    elif missing < 0:
        a = a.reshape((1,) * -missing + a.shape)
    return a.T, b.T


def cross(a: Array, b: Array) -> Array:
    """Cross product along the last axis. Shape (..., 3)."""
    # a few operations on whole rows: with few envs it is their number that takes time
    a, b = _components(a, b)
    products = a.take(_LEFT, axis=0) * b.take(_RIGHT, axis=0)
    return (products[:3] - products[3:]).T


def rotate(q: Array, v: Array) -> Array:
    """Rotate vectors v (..., 3) by unit quaternions q (..., 4)."""
    q, v = _components(q, v)
    left = q.take(_LEFT, axis=0)
    products = left * v.take(_RIGHT, axis=0)
    t = 2.0 * (products[:3] - products[3:])
    products = left * t.take(_RIGHT, axis=0)
    return (v + q[3:4] * t + (products[:3] - products[3:])).T


def rotate_inverse(q: Array, v: Array) -> Array:
    """Rotate vectors v (..., 3) by the inverses of unit quaternions q (..., 4)."""
    return rotate(conjugate(q), v)


def compose(a: Array, b: Array) -> Array:
    """The pose b expressed in the frame a, seen from a's parent: a∘b. Shapes (..., 7)."""
    turn = a[..., 3:]
    return np.concatenate([a[..., :3] + rotate(turn, b[..., :3]), multiply(turn, b[..., 3:])], axis=-1)


class Offset:
    """A pose fixed in frames that move: what `compose` does with it, its share of the work done once."""

    def __init__(self, pose: Array) -> None:
        """`pose` is (7,)."""
        self._position, quaternion = pose[:3, None], pose[3:]
        self._crossed = 2.0 * pose[_RIGHT, None]  # twice what is rounded is what is rounded twice as large
        self._turns = (quaternion[_SECOND] * _SIGNS)[..., None]

    def seen_from(self, frames: Array) -> Array:
        """Where it is, in these frames (n, 7): the same bits as `compose(frames, pose)`."""
        frames = frames.T
        turn = frames.take(_TURNS, axis=0)
        left, first = turn[:6], turn[6:]
        products = left * self._crossed
        t = products[:3] - products[3:]
        products = left * t.take(_RIGHT, axis=0)
        poses = np.empty_like(frames)
        np.add(frames[:3], self._position + first[0] * t + (products[:3] - products[3:]), out=poses[:3])
        rows = first[:, None] * self._turns
        np.add(rows[0] + rows[1] + rows[2], rows[3], out=poses[3:])
        return poses.T


def inverse(pose: Array) -> Array:
    """The inverse pose. Shape (..., 7)."""
    q = conjugate(pose[..., 3:])
    return np.concatenate([-rotate(q, pose[..., :3]), q], axis=-1)


def unsigned(pose: Array) -> Array:
    """The same poses (..., 7), as copies whose quaternions have no negative scalar part."""
    same = pose.copy()
    wrong = pose[..., 6:] < 0
    if np.count_nonzero(wrong):
        turn = same[..., 3:]
        np.negative(turn, out=turn, where=wrong)
    return same


def pose(position: Array | tuple[float, ...], quaternion: Array | tuple[float, ...]) -> Array:
    """One pose (7,) from its parts."""
    return np.concatenate([np.asarray(position, dtype=float), np.asarray(quaternion, dtype=float)], axis=-1)


def from_axis_angle(axis: Array, angle: Array) -> Array:
    """Quaternion (..., 4) of a rotation by `angle` (...) about the unit vector `axis` (..., 3)."""
    half = 0.5 * np.asarray(angle, dtype=float)
    return np.concatenate([axis * np.sin(half)[..., None], np.cos(half)[..., None]], axis=-1)


def from_roll_pitch_yaw(rpy: Array) -> Array:
    """Quaternion (..., 4) of fixed-axis roll, then pitch, then yaw (..., 3), as in URDF."""
    rpy = np.asarray(rpy, dtype=float)
    h = 0.5 * rpy
    sr, sp, sy = np.sin(h[..., 0]), np.sin(h[..., 1]), np.sin(h[..., 2])
    cr, cp, cy = np.cos(h[..., 0]), np.cos(h[..., 1]), np.cos(h[..., 2])
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ],
        axis=-1,
    )


def to_roll_pitch_yaw(q: Array) -> Array:
    """Fixed-axis roll, pitch and yaw (..., 3) of unit quaternions (..., 4), as `from_roll_pitch_yaw` takes them."""
    x, y, z, w = np.moveaxis(q, -1, 0)
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.minimum(np.maximum(2.0 * (w * y - z * x), -1.0), 1.0))
    return np.stack([roll, pitch, yaw(q)], axis=-1)


def exact_roll_pitch_yaw(q: Iterable[float]) -> Array:
    """Roll, pitch and yaw (3,) of one unit quaternion, to rounding also where the pitch is a right angle.

    Each angle is taken of what the others leave: an error of one is made good by the next.
    """
    left = to_matrix(np.array(tuple(q)))
    flat = float(np.hypot(left[0, 0], left[1, 0]))
    yaw = float(np.arctan2(left[1, 0], left[0, 0])) if flat > 1e-9 else 0.0
    left = M.product(_about(2, -yaw), left)
    pitch = float(np.arctan2(-left[2, 0], left[0, 0]))
    left = M.product(_about(1, -pitch), left)
    return np.array([float(np.arctan2(left[2, 1], left[1, 1])), pitch, yaw])


def _about(axis: int, angle: float) -> Array:
    turn = np.eye(3)
    one, other = (axis + 1) % 3, (axis + 2) % 3
    turn[one, one] = turn[other, other] = np.cos(angle)
    turn[other, one], turn[one, other] = np.sin(angle), -np.sin(angle)
    return turn


def yaw(q: Array) -> Array:
    """Directions (...) [rad] of the x axes of unit quaternions (..., 4) over the ground."""
    x, y, z, w = np.moveaxis(q, -1, 0)
    return np.arctan2(2.0 * (x * y + z * w), 1.0 - 2.0 * (y * y + z * z))


def wrapped(angle: Angle) -> Angle:
    """The same angles [rad] within [-pi, pi)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def to_matrix(q: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    m = np.empty((*q.shape[:-1], 3, 3))
    m[..., 0, 0], m[..., 0, 1], m[..., 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    m[..., 1, 0], m[..., 1, 1], m[..., 1, 2] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    m[..., 2, 0], m[..., 2, 1], m[..., 2, 2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
    return m


def from_matrix(matrix: Array) -> Array:
    """Unit quaternion (4,) of one rotation matrix (3, 3), with w >= 0 (Shepperd's method)."""
    m = np.asarray(matrix, dtype=float)
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    choices = [m[0, 0], m[1, 1], m[2, 2], trace]
    i = int(np.argmax(choices))
    q = np.empty(4)
    if i == 3:
        q[:] = [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1 + trace]
    else:
        j, k = (i + 1) % 3, (i + 2) % 3
        q[i] = 1 - trace + 2 * m[i, i]
        q[j] = m[j, i] + m[i, j]
        q[k] = m[k, i] + m[i, k]
        q[3] = m[k, j] - m[j, k]
    q /= norm(q)
    return -q if q[3] < 0 else q


def rotation_vector(q: Array) -> Array:
    """Axis times angle (..., 3) of unit quaternions (..., 4), angle in [0, pi]."""
    q = np.where(q[..., 3:] < 0, -q, q)
    sine = norm(q[..., :3])
    angle, small = 2.0 * np.arctan2(sine, q[..., 3]), sine < 1e-12
    scale = np.where(small, 2.0, angle / np.where(small, 1.0, sine))
    return q[..., :3] * scale[..., None]


def from_rotation_vector(v: Array) -> Array:
    """Unit quaternions (..., 4) of rotation vectors (..., 3)."""
    half = 0.5 * norm(v)[..., None]
    return np.concatenate([0.5 * np.sinc(half / np.pi) * v, np.cos(half)], axis=-1)


def angle_between(a: Array, b: Array) -> Array:
    """The angle [rad] (...) of the rotation from a to b (..., 4)."""
    return norm(rotation_vector(multiply(conjugate(a), b)))


def look_at(eye: Array, target: Array) -> Array:
    """Optical-frame quaternions (..., 4) (x right, y down, z forward) of cameras at `eye` (..., 3), towards `target`.

    The image's up is the world's z; a camera that looks straight up or down has the world's y as its up.
    """
    forward = target - eye
    forward = forward / norm(forward)[..., None]
    up = np.broadcast_to(np.array([0.0, 0.0, 1.0]), forward.shape)
    right = cross(forward, up)
    size = norm(right)[..., None]
    steep = size < 1e-6
    right = np.where(steep, np.array([1.0, 0.0, 0.0]), right / np.where(steep, 1.0, size))
    down = cross(forward, right)
    matrix = np.stack([right, down, forward], axis=-1)
    flat = matrix.reshape(-1, 3, 3)
    return np.array([from_matrix(m) for m in flat]).reshape(*forward.shape[:-1], 4)


def step_toward(pose: Array, target: Array, max_distance: float | Array, max_angle: float | Array) -> Array:
    """Move poses (n, 7) straight towards targets (n, 7): at most `max_distance` [m] and `max_angle` [rad], () or (n,).

    Position and rotation keep pace: both cover the same fraction of what is left, so they arrive together.
    """
    distance = norm(target[:, :3] - pose[:, :3])
    turn = rotation_vector(multiply(conjugate(pose[:, 3:]), target[:, 3:]))
    angle = norm(turn)
    share = np.minimum(
        1.0, np.minimum(max_distance / np.maximum(distance, 1e-12), max_angle / np.maximum(angle, 1e-12))
    )
    position = pose[:, :3] + share[:, None] * (target[:, :3] - pose[:, :3])
    axis = turn / np.maximum(angle, 1e-12)[:, None]
    rotation = normalize(multiply(pose[:, 3:], from_axis_angle(axis, share * angle)))
    return np.concatenate([position, rotation], axis=1)

"""Rotations of many limbs at once: frames from directions, two-bone limbs, quaternions of matrices."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P


def unit(v: Array) -> Array:
    """Vectors (…, 3) of length one."""
    return v / np.maximum(P.norm(v), 1e-12)[..., None]


def along(direction: Array, left: Array) -> Array:
    """Rotations (…, 3, 3) whose z is a direction, and whose y is as near to `left` as can be."""
    z = unit(direction)
    x = unit(P.cross(np.broadcast_to(left, z.shape), z))
    return np.stack([x, P.cross(z, x), z], axis=-1)


def turned(yaw: Array, pitch: Array, roll: Array | None = None) -> Array:
    """Rotations (…, 3, 3): a roll about x, a pitch about y (forward down is positive), then a yaw about z."""
    cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    zero = np.zeros_like(cy)
    level = np.stack(
        [np.stack([cy, sy, zero], -1), np.stack([-sy, cy, zero], -1), np.stack([zero, zero, zero + 1], -1)], -1
    )
    tipped = np.stack(
        [np.stack([cp, zero, -sp], -1), np.stack([zero, zero + 1, zero], -1), np.stack([sp, zero, cp], -1)], -1
    )
    both = level @ tipped
    if roll is None:
        return both
    cr, sr = np.cos(roll), np.sin(roll)
    rolled = np.stack(
        [np.stack([zero + 1, zero, zero], -1), np.stack([zero, cr, sr], -1), np.stack([zero, -sr, cr], -1)], -1
    )
    return both @ rolled


def apply(rotation: Array, v: Array) -> Array:
    """Vectors (…, 3) rotated by matrices (…, 3, 3)."""
    return (rotation @ np.broadcast_to(v, rotation.shape[:-1])[..., None])[..., 0]


def quaternions(rotation: Array) -> Array:
    """(…, 4) xyzw of matrices (…, 3, 3), by the largest component."""
    m = rotation
    d = np.stack([m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]], axis=-1)
    sums = np.concatenate([2 * d - d.sum(-1, keepdims=True), d.sum(-1, keepdims=True)], axis=-1)
    big = sums.argmax(axis=-1)
    a = np.stack([m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], axis=-1)
    s = [m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]]
    one = 1.0 + sums
    rows = [
        np.stack([one[..., 0], s[0], s[1], a[..., 0]], axis=-1),
        np.stack([s[0], one[..., 1], s[2], a[..., 1]], axis=-1),
        np.stack([s[1], s[2], one[..., 2], a[..., 2]], axis=-1),
        np.concatenate([a, one[..., 3:]], axis=-1),
    ]
    chosen = np.take_along_axis(np.stack(rows, axis=-2), big[..., None, None], axis=-2)[..., 0, :]
    return chosen / np.sqrt((chosen * chosen).sum(-1, keepdims=True))


def limb(root: Array, target: Array, upper: Array, lower: Array, pole: Array) -> tuple[Array, Array, Array]:
    """Middle (…, 3) and end (…, 3) of two bones from `root` towards `target`, and how far it stays away (…,) [m].

    The middle bends towards `pole`; out of reach the limb is straight, and its end as near as it gets.
    """
    gap = target - root
    distance = P.norm(gap)
    straight, folded = upper + lower, np.abs(upper - lower)
    reach = np.clip(distance, folded + 1e-9, straight)
    axis = unit(gap)
    side = unit(pole - P.dot(pole, axis)[..., None] * axis)
    shift = (upper**2 - lower**2 + reach**2) / (2 * np.maximum(reach, 1e-9))
    out = np.sqrt(np.maximum(upper**2 - shift**2, 0.0))
    middle = root + shift[..., None] * axis + out[..., None] * side
    end = root + reach[..., None] * axis
    end = np.where((distance == reach)[..., None], target, end)
    return middle, end, np.abs(distance - reach)

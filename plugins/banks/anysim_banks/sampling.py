"""Sampling of grasps of a parallel gripper on convex pieces: opposite faces, diameters, and pairs in friction cones."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.affordances import Affordance
from anysim.model.world import Box, Capsule, Cylinder, Sphere
from anysim_banks.pieces import Hull, Piece

USED = 0.9
"""Share of a face, or of a length, on which pads are put: not at its edges."""
AIM = 0.35
"""[rad] that an approach may be off a declared direction, to stay at right angles to where the fingers close."""
CONE = 0.5
"""Friction coefficient within whose cone two points of a mesh oppose each other."""
BAR = 2.0
"""A round thing that is so many times as long as wide is a bar: it is not taken hold of along its axis."""


class Candidates(NamedTuple):
    """Grasps, not tried yet: tool poses (n, 7) in the body's frame, widths (n,) [m], kinds and piece numbers (n,)."""

    pose: Array
    width: Array
    kind: Array
    piece: Array

    def take(self, which: Array) -> "Candidates":
        """Some of them."""
        return Candidates(*(column[which] for column in self))


class _Grips(NamedTuple):
    """In a piece's frame: middles (n, 3), closing directions (n, 3), approaches (n, 3), widths (n,), kinds (n,)."""

    middle: Array
    closing: Array
    approach: Array
    width: Array
    kind: Array


def sample(
    pieces: Sequence[Piece],
    affordance: Affordance,
    frame: Array,
    count: int,
    max_width: float,
    rng: np.random.Generator,
) -> Candidates:
    """At most `count` grasps, alike many on each piece; none on what is wider than `max_width` [m].

    `frame` (7,) is the affordance's frame in the body's, along which its directions of approach are.
    """
    found: list[Candidates] = []
    share = -(-count // max(1, len(pieces)))
    for number, piece in enumerate(pieces):
        had = 0
        for _ in range(20):  # a declared direction leaves few of those sampled at once
            grips = _on(piece, max(64, 2 * share), max_width, rng)
            made = _placed(grips, piece, number)
            if affordance.approach:
                made = _aimed(made, affordance, frame, rng)
            found.append(made.take(np.arange(len(made.width))[: share - had]))
            had += len(found[-1].width)
            if had >= share or len(grips.width) == 0:
                break
    whole = Candidates(*(np.concatenate(column) for column in zip(*found, strict=True)))
    return whole.take(rng.permutation(len(whole.width))[:count])


def tool_turn(closing: Array, approach: Array) -> Array:
    """Quaternions (n, 4), w >= 0, of tools whose y is `closing` and z `approach`, unit and at right angles (n, 3)."""
    m = np.stack([np.cross(closing, approach), closing, approach], axis=-1)
    xx, yy, zz = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    # four times the products of the quaternion with each of its components; the row of the largest is exact
    x, y, z = m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]
    xy, xz, yz = m[:, 1, 0] + m[:, 0, 1], m[:, 2, 0] + m[:, 0, 2], m[:, 2, 1] + m[:, 1, 2]
    products = np.stack(
        [
            np.stack([1 + xx - yy - zz, xy, xz, x], axis=1),
            np.stack([xy, 1 - xx + yy - zz, yz, y], axis=1),
            np.stack([xz, yz, 1 - xx - yy + zz, z], axis=1),
            np.stack([x, y, z, 1 + xx + yy + zz], axis=1),
        ],
        axis=1,
    )
    best = products[np.arange(len(m)), np.einsum("nkk->nk", products).argmax(axis=1)]
    best = _unit(best)
    return np.where(best[:, 3:] < 0, -best, best)


def _placed(grips: _Grips, piece: Piece, number: int) -> Candidates:
    turn = piece.pose[3:]
    pose = np.concatenate([grips.middle, tool_turn(grips.closing, grips.approach)], axis=1)
    at = np.broadcast_to(np.concatenate([piece.pose[:3], turn]), pose.shape)
    return Candidates(P.compose(at, pose), grips.width, grips.kind, np.full(len(pose), number))


def _aimed(made: Candidates, affordance: Affordance, frame: Array, rng: np.random.Generator) -> Candidates:
    """Grasps turned about where they close, to come from a declared direction; those that cannot are left out."""
    n = len(made.width)
    way = np.array(affordance.approach)[rng.integers(len(affordance.approach), size=n)]
    roll = P.from_axis_angle(np.array([0.0, 0.0, 1.0]), rng.uniform(*affordance.roll, size=n))
    wanted = P.rotate(frame[3:], P.rotate(roll, way))
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    closing = P.rotate(made.pose[:, 3:], np.array([0.0, 1.0, 0.0]))
    along = np.einsum("nk,nk->n", wanted, closing)
    keep = np.abs(along) < np.sin(AIM)
    approach = _unit((wanted - along[:, None] * closing)[keep])
    closing = closing[keep]
    turned = np.concatenate([made.pose[keep, :3], tool_turn(closing, approach)], axis=1)
    return Candidates(turned, made.width[keep], made.kind[keep], made.piece[keep])


def _on(piece: Piece, n: int, max_width: float, rng: np.random.Generator) -> _Grips:
    match piece.shape:
        case Box(half):
            return _box(np.array(half), n, max_width, rng)
        case Sphere(radius):
            return _sphere(radius, n, max_width, rng)
        case Capsule(radius, half):
            return _round(radius, half, n, max_width, rng, "bar" if half > BAR * radius else "capsule", caps=False)
        case Cylinder(radius, half):
            return _round(radius, half, n, max_width, rng, "bar" if half > BAR * radius else "cylinder", caps=True)
        case _:
            assert piece.hull is not None  # of a mesh; pieces have no other shapes
            return _hull(piece.hull, n, max_width, rng)


def _box(half: Array, n: int, max_width: float, rng: np.random.Generator) -> _Grips:
    axes = np.flatnonzero(2 * half <= max_width)
    if len(axes) == 0:
        return _none()
    axis = rng.choice(axes, n)
    closing = np.eye(3)[axis] * rng.choice([-1.0, 1.0], n)[:, None]
    middle = rng.uniform(-USED, USED, (n, 3)) * half
    middle[np.arange(n), axis] = 0.0
    return _Grips(middle, closing, _across(closing, rng), 2 * half[axis], np.full(n, "box"))


def _sphere(radius: float, n: int, max_width: float, rng: np.random.Generator) -> _Grips:
    if 2 * radius > max_width:
        return _none()
    closing = _unit(rng.normal(size=(n, 3)))
    return _Grips(np.zeros((n, 3)), closing, _across(closing, rng), np.full(n, 2 * radius), np.full(n, "sphere"))


def _round(
    radius: float, half: float, n: int, max_width: float, rng: np.random.Generator, name: str, *, caps: bool
) -> _Grips:
    """Diameters at any height, from any direction at right angles; of flat ends also from cap to cap."""
    side = 2 * radius <= max_width
    ends = caps and 2 * half <= max_width
    if not side and not ends:
        return _none()
    turn = rng.uniform(0, 2 * np.pi, n)
    closing = np.stack([np.cos(turn), np.sin(turn), np.zeros(n)], axis=1)
    middle = np.zeros((n, 3))
    middle[:, 2] = rng.uniform(-USED, USED, n) * half
    approach = _across(closing, rng)
    if name == "bar":  # across it: the palm would run into its length
        approach = _unit(np.cross(np.array([0.0, 0.0, 1.0]), closing)) * rng.choice([-1.0, 1.0], n)[:, None]
    width, kind = np.full(n, 2 * radius), np.full(n, name, dtype="<U16")
    flat = rng.random(n) < (1.0 if not side else 0.3) if ends else np.zeros(n, dtype=bool)
    if flat.any():
        k = int(flat.sum())
        reach = USED * radius * np.sqrt(rng.random(k))
        middle[flat] = np.stack([reach * np.cos(turn[flat]), reach * np.sin(turn[flat]), np.zeros(k)], axis=1)
        closing[flat] = np.array([0.0, 0.0, 1.0]) * rng.choice([-1.0, 1.0], k)[:, None]
        approach[flat] = _across(closing[flat], rng)
        width[flat], kind[flat] = 2 * half, f"{name} cap"
    return _Grips(middle, closing, approach, width, kind)


def _hull(hull: Hull, n: int, max_width: float, rng: np.random.Generator) -> _Grips:
    """A point of the surface, a line into it within the friction cone, and where that comes out."""
    a, b, c = (hull.corners[:, k] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    face = rng.choice(len(area), n, p=area / area.sum())
    u, v = rng.random((2, n, 1))
    over = u + v > 1
    u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
    point = a[face] + u * (b - a)[face] + v * (c - a)[face]
    normal = hull.normals[face]
    slope = CONE * np.sqrt(rng.random((n, 1)))
    into = _unit(-normal + slope * _across(normal, rng))
    facing = into @ hull.normals.T
    ahead = hull.offsets - point @ hull.normals.T
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.where(facing > 1e-9, ahead / facing, np.inf)
    exit_face = out.argmin(axis=1)
    width = out[np.arange(n), exit_face]
    opposed = np.einsum("nk,nk->n", hull.normals[exit_face], into) >= 1.0 / np.hypot(1.0, CONE)
    keep = opposed & (width <= max_width) & (width > 1e-4)
    middle = (point + 0.5 * width[:, None] * into)[keep]
    return _Grips(middle, into[keep], _across(into[keep], rng), width[keep], np.full(int(keep.sum()), "mesh"))


def _across(vectors: Array, rng: np.random.Generator) -> Array:
    """Random unit vectors at right angles to unit vectors (n, 3)."""
    helper = np.eye(3)[np.abs(vectors).argmin(axis=1)]
    one = _unit(np.cross(vectors, helper))
    angle = rng.uniform(0, 2 * np.pi, (len(vectors), 1))
    return np.cos(angle) * one + np.sin(angle) * np.cross(vectors, one)


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _none() -> _Grips:
    rows = np.zeros((0, 3))
    return _Grips(rows, rows, rows, np.zeros(0), np.zeros(0, dtype="<U16"))

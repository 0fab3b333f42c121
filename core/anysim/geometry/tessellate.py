"""Primitives as triangles, for renderers that draw nothing else or put textures on their own shapes in another way."""

from math import pi

import numpy as np

from anysim.conventions import Array
from anysim.model.shapes import Box, Capsule, Cylinder, Shape, Sphere

ROUND = 16
"""Half the corners around a round shape, and the rings of a ball from pole to pole: within 0.5 % of its outline."""


def triangles(shape: Shape) -> tuple[Array, Array] | None:
    """Vertices (V, 3) [m] and faces (T, 3) of a primitive, counter-clockwise from outside; None for other shapes."""
    match shape:
        case Box(half):
            return box(np.array(half))
        case Sphere(r):
            bend = np.linspace(-pi / 2, pi / 2, ROUND)
            return turned(r * np.cos(bend), r * np.sin(bend))
        case Capsule(r, h):
            bend = np.linspace(0.0, pi / 2, ROUND // 2)
            across, up = r * np.cos(bend), h + r * np.sin(bend)
            return turned(np.concatenate([across[::-1], across]), np.concatenate([-up[::-1], up]))
        case Cylinder(r, h):
            return turned(np.array([0.0, r, r, 0.0]), np.array([-h, -h, h, h]))
        case _:
            return None


def box(half: Array) -> tuple[Array, Array]:
    """Vertices and triangles of a box of half edge lengths (3,)."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))])


def turned(across: Array, height: Array) -> tuple[Array, Array]:
    """Vertices and triangles of the body that a profile (K,), from below to above, makes turning about z [m]."""
    turn = np.arange(2 * ROUND) * (pi / ROUND)
    x, y = np.multiply.outer(across, np.cos(turn)), np.multiply.outer(across, np.sin(turn))
    vertices = np.stack([x, y, np.broadcast_to(height[:, None], x.shape)], axis=-1).reshape(-1, 3)
    ring, place = np.meshgrid(np.arange(len(across) - 1), np.arange(2 * ROUND), indexing="ij")
    a = (ring * 2 * ROUND + place).ravel()
    b = (ring * 2 * ROUND + (place + 1) % (2 * ROUND)).ravel()
    lower, upper = np.stack([a, b, b + 2 * ROUND], axis=1), np.stack([a, b + 2 * ROUND, a + 2 * ROUND], axis=1)
    return vertices, np.concatenate([lower, upper])

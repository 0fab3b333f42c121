"""Worlds of the contract suite about ground: slopes and steps with known answers."""

from math import cos, sin, tan

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.model.world import Box, Geom, HeightField, HeightFieldShape, Mesh, MeshShape, Sphere, Surface, World
from anysim.testing.sketch import Sketch

RADIUS = 0.1
STEP = 0.2
"""[m] height of a step of the stairs."""

GRIP = Surface(friction=1.0)


def field_triangles(field: HeightField) -> tuple[Array, Array]:
    """Vertices and triangles of a height field, by the edge that the conventions say."""
    rows, cols = field.heights.shape
    x, y = (np.linspace(-e / 2, e / 2, n) for e, n in zip(field.size, (cols, rows), strict=True))
    vertices = np.stack([*np.meshgrid(x, y), field.heights], axis=-1).reshape(-1, 3)
    corner = (np.arange(rows - 1)[:, None] * cols + np.arange(cols - 1)).ravel()
    lower = np.stack([corner, corner + 1, corner + cols + 1], axis=1)
    upper = np.stack([corner, corner + cols + 1, corner + cols], axis=1)
    return vertices, np.concatenate([lower, upper])


def put(s: Sketch, heights: Array, size: tuple[float, float], as_mesh: bool) -> None:
    """The ground of a sketch: a height field, or the same triangles as a concave mesh."""
    field = HeightField("ground", heights, size)
    if as_mesh:
        vertices, faces = field_triangles(field)
        s.more["meshes"] = (Mesh("ground", vertices, faces.astype(np.int32), "contract-ground"),)
        s.geoms.append(Geom("terrain", WORLD, MeshShape("ground", concave=True), surface=GRIP))
    else:
        s.more["heightfields"] = (field,)
        s.geoms.append(Geom("terrain", WORLD, HeightFieldShape("ground"), surface=GRIP))


def ramp(angle: float, as_mesh: bool) -> World:
    """A ramp down +x with a ball that touches it, and beside it one that is across the slope by its orientation."""
    s = Sketch("ramp", 0.001)
    size = (8.0, 4.0)
    x = np.linspace(-4.0, 4.0, 81)
    put(s, np.tile(-tan(angle) * x, (41, 1)), size, as_mesh)
    away = np.array([sin(angle), 0.0, cos(angle)])
    at = np.array([-2.03, 0.52, 2.03 * tan(angle)]) + RADIUS * away
    s.free("ball", Sphere(RADIUS), (float(at[0]), float(at[1]), float(at[2])), surface=GRIP)
    at = np.array([-1.0, -0.87, tan(angle)]) + 0.05 * away
    turn = (0.0, sin(angle / 2), 0.0, cos(angle / 2))
    s.free("box", Box((0.15, 0.15, 0.05)), (float(at[0]), float(at[1]), float(at[2])), quaternion=turn, surface=GRIP)
    return s.world()


def stairs(as_mesh: bool) -> World:
    """Four steps up +x, 0.5 m deep, with a ball a little above each tread."""
    s = Sketch("stairs", 0.001)
    x = np.linspace(-1.0, 1.0, 41)
    treads = STEP * np.clip(np.floor((x + 1.0) / 0.5 + 1e-9), 0, 3)
    put(s, np.tile(treads, (21, 1)), (2.0, 1.0), as_mesh)
    for k in range(4):
        s.free(f"ball{k}", Sphere(RADIUS), (-0.75 + 0.5 * k, 0.013, STEP * k + RADIUS + 0.005), surface=GRIP)
    return s.world()


def hills(as_mesh: bool) -> World:
    """Random heights over unequal cells, for rays."""
    s = Sketch("hills")
    put(s, np.random.default_rng(7).uniform(-0.3, 0.3, size=(13, 18)), (4.0, 3.0), as_mesh)
    return s.world()

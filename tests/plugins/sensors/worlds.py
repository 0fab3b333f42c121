"""Worlds of random shapes, and slow answers to compare with."""

import numpy as np

from anysim.conventions import Array
from anysim.geometry.triangles import convex_hull
from anysim.math import pose as P
from anysim.model.world import Box, Capsule, Cylinder, Mesh, MeshShape, Quat, Shape, Sphere, Vec3, World
from anysim.testing.sketch import Sketch, inertial

HERE = P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def quaternion(rng: np.random.Generator) -> Quat:
    x, y, z, w = (float(v) for v in P.normalize(rng.normal(size=4)))
    return (x, y, z, w)


def crowd(rng: np.random.Generator, count: int, ground: bool = True) -> World:
    """Boxes, balls, capsules, cylinders and hulls in turn, in a space of 8 m, turned at random and overlapping."""
    s = Sketch("crowd")
    if ground:
        s.ground()
    meshes: list[Mesh] = []
    for i in range(count):
        a, b, c = (float(v) for v in rng.uniform(0.05, 0.4, 3))
        shape: Shape
        match i % 5:
            case 0:
                shape = Box((a, b, c))
            case 1:
                shape = Sphere(a)
            case 2:
                shape = Capsule(a, b)
            case 3:
                shape = Cylinder(a, b)
            case _:
                vertices, faces = convex_hull(rng.normal(size=(40, 3)) * [a, b, c], 64)
                meshes.append(Mesh(f"hull{i}", vertices, faces, f"crowd{i}{a}"))
                shape = MeshShape(f"hull{i}")
        mass = inertial(shape if i % 5 < 4 else Sphere(0.1), 1.0)
        s.free(f"thing{i}", shape, at(rng), quaternion=quaternion(rng), inertia=mass)
    s.more["meshes"] = tuple(meshes)
    return s.world()


def at(rng: np.random.Generator) -> Vec3:
    x, y, z = (float(v) for v in rng.uniform([-4.0, -4.0, 0.3], [4.0, 4.0, 2.5]))
    return (x, y, z)


def ray_triangles(origin: Array, direction: Array, corners: Array) -> Array:
    """Distances (R,) to the nearest of triangles (T, 3, 3), by solving a system for each pair; inf."""
    found = np.full(len(origin), np.inf)
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
    for r in range(len(origin)):
        matrix = np.concatenate([edges, np.broadcast_to(-direction[r][:, None], (len(edges), 3, 1))], axis=-1)
        usable = np.abs(np.linalg.det(matrix)) > 1e-14
        u, v, t = np.linalg.solve(matrix[usable], (origin[r] - corners[usable, 0])[..., None])[..., 0].T
        hit = (u >= -1e-12) & (v >= -1e-12) & (u + v <= 1 + 1e-12) & (t >= 0)
        found[r] = t[hit].min(initial=np.inf)
    return found


def nearest_triangle(points: Array, corners: Array) -> Array:
    """Distances (R,) to the nearest of triangles (T, 3, 3): of its plane if above it, else of its three edges."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    best = np.full(len(points), np.inf)
    for r, point in enumerate(points):
        inside = np.ones(len(corners), dtype=bool)
        for start, end in ((a, b), (b, c), (c, a)):
            along = end - start
            share = np.clip(((point - start) * along).sum(1) / (along * along).sum(1), 0, 1)
            best[r] = min(best[r], np.linalg.norm(start + share[:, None] * along - point, axis=1).min())
            inside &= (np.cross(along, point - start) * normal).sum(1) >= 0
        best[r] = min(best[r], np.abs(((point - a) * normal).sum(1))[inside].min(initial=np.inf))
    return best

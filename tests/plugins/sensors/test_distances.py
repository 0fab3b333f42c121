"""Signed distances of points: exact on shapes, and right on triangles, inside and outside."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.math import pose as P
from anysim.model.world import Box, Capsule, Cylinder, HeightField, HeightFieldShape, Mesh, MeshShape, Shape, Sphere
from anysim.testing.sketch import Sketch
from anysim_sensors.scene import SceneGeometry
from tests.plugins.sensors import worlds
from tests.plugins.sensors.worlds import HERE

SHAPES = [Box((0.3, 0.2, 0.5)), Sphere(0.4), Capsule(0.2, 0.3), Cylinder(0.3, 0.25)]


def measured(shape: Shape, points: np.ndarray, place: np.ndarray, **parts):
    s = Sketch("one")
    s.fixed("thing", shape, tuple(place[:3]), quaternion=tuple(place[3:]))
    scene = SceneGeometry(replace(s.world(), **parts))
    posed = scene.posed(scene.world.initial_body_pose[None])
    return scene.distances(posed, HERE[None], points, normals=True)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)
def test_the_nearest_point_of_a_shape_is_on_it_and_no_other_is_nearer(shape: Shape) -> None:
    rng = np.random.default_rng(1)
    place = P.pose((0.1, -0.2, 0.05), worlds.quaternion(rng))
    points = rng.uniform(-1, 1, (2000, 3))
    found = measured(shape, points, place)
    distance, normal = found.distance[0], found.normal[0]
    local = P.rotate_inverse(place[3:], points - place[:3])
    surface = samples(shape)
    # every point of the surface is at least as far, and the foot of the distance is a point of the surface
    for near, p in zip(np.abs(distance), local, strict=True):
        assert np.linalg.norm(surface - p, axis=1).min() > near - 1e-9
    foot = P.rotate_inverse(place[3:], points - distance[:, None] * normal - place[:3])
    again = measured(shape, P.rotate(place[3:], foot) + place[:3], place).distance[0]
    assert np.abs(again).max() < 1e-9
    assert (distance < 0).sum() > 20
    assert ((distance < 0) == (within(shape, local))).all()
    assert np.abs(np.linalg.norm(normal, axis=1) - 1).max() < 1e-12


def within(shape: Shape, p: np.ndarray) -> np.ndarray:
    match shape:
        case Box(half):
            return np.abs(p / half).max(axis=1) < 1
        case Sphere(radius):
            return (p**2).sum(1) < radius**2
        case Cylinder(radius, half):
            return ((p[:, :2] ** 2).sum(1) < radius**2) & (np.abs(p[:, 2]) < half)
        case Capsule(radius, half):
            return ((p - np.clip(p, [0, 0, -half], [0, 0, half])) ** 2).sum(1) < radius**2
        case _:
            raise TypeError


def samples(shape: Shape) -> np.ndarray:
    """Points of the surface (S, 3), exact."""
    turn = np.linspace(0, 2 * np.pi, 60)
    u = np.linspace(-1, 1, 25)
    match shape:
        case Box(half):
            a, b = (v.ravel() for v in np.meshgrid(u, u))
            faces = [
                np.roll(np.column_stack([side * np.ones_like(a), a, b]), k, 1) for k in range(3) for side in (-1, 1)
            ]
            return np.concatenate(faces) * half
        case Sphere(radius):
            t, z = (v.ravel() for v in np.meshgrid(turn, u))
            flat = np.sqrt(np.maximum(1 - z * z, 0))
            return radius * np.column_stack([flat * np.cos(t), flat * np.sin(t), z])
        case Capsule(radius, half):
            ball = samples(Sphere(radius))
            t, z = (v.ravel() for v in np.meshgrid(turn, u * half))
            tube = np.column_stack([radius * np.cos(t), radius * np.sin(t), z])
            return np.concatenate([tube, ball + np.where(ball[:, 2:] >= 0, half, -half) * [[0, 0, 1]]])
        case Cylinder(radius, half):
            t, z = (v.ravel() for v in np.meshgrid(turn, u))
            tube = np.column_stack([radius * np.cos(t), radius * np.sin(t), z * half])
            ends = [
                np.column_stack([z * radius * np.cos(t), z * radius * np.sin(t), s * np.ones_like(t)])
                for s in (-half, half)
            ]
            return np.concatenate([tube, *ends])
        case _:
            raise TypeError


def torus(rings: int = 24, sides: int = 16) -> Mesh:
    """A closed mesh that is not convex, with vertices given twice where the file would have a seam."""
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, rings + 1), np.linspace(0, 2 * np.pi, sides + 1), indexing="ij")
    a[-1], b[:, -1] = 0.0, 0.0
    ring = 0.5 + 0.2 * np.cos(b)
    vertices = np.stack([ring * np.cos(a), ring * np.sin(a), 0.2 * np.sin(b)], axis=-1).reshape(-1, 3)
    n = np.arange((rings + 1) * (sides + 1)).reshape(rings + 1, sides + 1)
    p, q, r, s = n[:-1, :-1].ravel(), n[1:, :-1].ravel(), n[1:, 1:].ravel(), n[:-1, 1:].ravel()
    faces = np.concatenate([np.column_stack([p, q, r]), np.column_stack([p, r, s])])
    return Mesh("torus", vertices, faces.astype(np.int32), "torus")


def test_a_mesh_is_as_far_as_by_trying_all_its_triangles_and_signed_by_what_is_inside() -> None:
    rng = np.random.default_rng(2)
    mesh = torus()
    points = rng.uniform([-0.9, -0.9, -0.4], [0.9, 0.9, 0.4], (1500, 3))
    points[:400] = mesh.vertices[rng.integers(0, len(mesh.vertices), 400)] + rng.normal(size=(400, 3)) * 0.02
    found = measured(MeshShape("torus"), points, HERE, meshes=(mesh,)).distance[0]
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.faces)]
    assert np.abs(np.abs(found) - worlds.nearest_triangle(points, corners)).max() < 1e-9
    # inside is where a ray meets the surface an odd number of times
    direction = P.normalize(np.array([0.3, 0.5, 0.81]))
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
    matrix = np.concatenate([edges, np.broadcast_to(-direction[:, None], (len(edges), 3, 1))], axis=-1)
    inverse = np.linalg.inv(matrix)
    u, v, t = np.moveaxis(np.einsum("tij,rtj->rti", inverse, points[:, None] - corners[None, :, 0]), -1, 0)
    odd = ((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)).sum(axis=1) % 2 == 1
    clear = np.abs(found) > 1e-9
    assert 300 < odd.sum() < 1200
    assert ((found < 0) == odd)[clear].all()


def test_below_ground_is_inside_of_it() -> None:
    heights = np.random.default_rng(4).uniform(-0.2, 0.2, (9, 13))
    points = np.random.default_rng(5).uniform([-1.5, -1.0, -0.8], [1.5, 1.0, 0.8], (800, 3))
    field = HeightField("hills", heights, (4.0, 3.0))
    found = measured(HeightFieldShape("hills"), points, HERE, heightfields=(field,))
    from anysim.model.ground import FieldGround

    above = points[:, 2] - FieldGround(field).heights_at(points[:, :2])
    assert ((found.distance[0] > 0) == (above > 0)).all()
    assert (np.abs(found.distance[0]) <= np.abs(above) + 1e-12).all()


def test_the_nearest_of_several_and_the_deepest_where_they_overlap() -> None:
    s = Sketch("several")
    s.ground()
    s.fixed("ball", Sphere(0.5), (0.0, 0.0, 1.0))
    s.fixed("box", Box((0.5, 0.5, 0.5)), (0.6, 0.0, 1.0))
    scene = SceneGeometry(s.world())
    posed = scene.posed(scene.world.initial_body_pose[None])
    points = np.array([[0.0, 0.0, 3.0], [0.0, 3.0, 0.2], [0.3, 0.0, 1.0], [0.6, 0.0, 1.0], [9.0, 9.0, -0.1]])
    found = scene.distances(posed, HERE[None], points, normals=True)
    assert found.distance[0] == pytest.approx([1.5, 0.2, -0.2, -0.5, -0.1], abs=1e-12)
    assert found.geom[0].tolist() == [1, 0, 1, 2, 0]
    assert np.abs(found.normal[0, :2] - [[0, 0, 1], [0, 0, 1]]).max() < 1e-12
    near = scene.distances(posed, HERE[None], points, reach=0.3, normals=True)
    assert np.isinf(near.distance[0, 0])
    assert near.geom[0, 0] == -1
    assert not near.normal[0, 0].any()
    assert near.distance[0, 1:].tobytes() == found.distance[0, 1:].tobytes()


def test_taxels_on_a_pad_ride_on_their_body() -> None:
    """Points and rays given in the frame of a body: a pad pressed 1 mm into a ball."""
    rng = np.random.default_rng(9)
    pad = P.pose((0.3, 0.1, 0.7), worlds.quaternion(rng))
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(-0.008, 0.008, 20), np.linspace(-0.008, 0.008, 20)))
    taxels = np.column_stack([x, y, np.zeros_like(x)])
    radius = 0.006
    ball = P.compose(pad, P.pose((0.0, 0.0, radius - 0.001), (0.0, 0.0, 0.0, 1.0)))
    s = Sketch("touch")
    s.fixed("ball", Sphere(radius), tuple(ball[:3]))
    scene = SceneGeometry(s.world())
    posed = scene.posed(scene.world.initial_body_pose[None])
    back = taxels - [0.0, 0.0, 0.005]
    rays = scene.rays(posed, pad[None], back, np.broadcast_to([0.0, 0.0, 1.0], back.shape), reach=0.005)
    depth = np.where(np.isfinite(rays.distance[0]), 0.005 - rays.distance[0], 0.0)
    square = x**2 + y**2
    answer = np.where(square < radius**2, np.sqrt(np.maximum(radius**2 - square, 0)) - (radius - 0.001), 0.0)
    assert np.abs(depth - np.maximum(answer, 0)).max() < 1e-12
    assert depth.max() > 0.0009
    near = scene.distances(posed, pad[None], taxels)
    assert np.abs(near.distance[0] - (np.sqrt(square + (radius - 0.001) ** 2) - radius)).max() < 1e-12

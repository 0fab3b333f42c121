"""Rays against posed geoms: exact on shapes, the same by whatever order or tree, and right on triangles."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.model.world import Box, Capsule, Cylinder, Mesh, MeshShape, Shape, Sphere, World
from anysim.testing.sketch import Sketch
from anysim.testing.varying import having, random_presence, with_slots
from anysim_sensors import scene as module
from anysim_sensors.camera import RayCamera
from anysim_sensors.occupancy import Grid, occupancy
from anysim_sensors.scene import SceneGeometry
from tests.plugins.sensors import worlds
from tests.plugins.sensors.worlds import HERE

Rays = tuple[np.ndarray, np.ndarray]


def one(shape: Shape, position=(0.0, 0.0, 0.0), quaternion=(0.0, 0.0, 0.0, 1.0)) -> World:
    s = Sketch("one")
    s.fixed("thing", shape, position, quaternion=quaternion)
    return s.world()


def aimed(rng: np.random.Generator, count: int, spread: float = 0.25) -> Rays:
    """Rays from 2 to 4 m away that pass near the origin."""
    start = P.normalize(rng.normal(size=(count, 3))) * rng.uniform(2, 4, (count, 1))
    return start, rng.normal(size=(count, 3)) * spread - start


SHAPES = [Box((0.3, 0.2, 0.5)), Sphere(0.4), Capsule(0.2, 0.3), Cylinder(0.3, 0.25)]


def outside(shape: Shape, p: np.ndarray) -> np.ndarray:
    """How far points (R, 3) are from the surface, by another formula than that of the kernels; negative inside."""
    match shape:
        case Box(half):
            return (np.abs(p) - half).max(axis=1)
        case Sphere(radius):
            return np.linalg.norm(p, axis=1) - radius
        case Capsule(radius, half):
            ends = np.array([[0, 0, -half], [0, 0, half]])
            ball = np.min([np.linalg.norm(p - end, axis=1) for end in ends], axis=0) - radius
            tube = np.hypot(p[:, 0], p[:, 1]) - radius
            return np.where(np.abs(p[:, 2]) <= half, tube, ball)
        case Cylinder(radius, half):
            return np.maximum(np.hypot(p[:, 0], p[:, 1]) - radius, np.abs(p[:, 2]) - half)
        case _:
            raise TypeError


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)
def test_a_ray_ends_on_the_surface_and_meets_nothing_before(shape: Shape) -> None:
    rng = np.random.default_rng(1)
    place = P.pose((0.1, -0.2, 0.05), worlds.quaternion(rng))
    world = one(shape, tuple(place[:3]), tuple(place[3:]))
    scene = SceneGeometry(world)
    origins, directions = aimed(rng, 3000)
    hits = scene.rays(scene.posed(world.initial_body_pose[None]), HERE[None], origins, directions, normals=True)
    distance, normal = hits.distance[0], hits.normal[0]
    along = P.normalize(directions)
    met = np.isfinite(distance)
    assert 800 < met.sum() < 2990
    end = P.rotate_inverse(place[3:], origins[met] + distance[met, None] * along[met] - place[:3])
    assert np.abs(outside(shape, end)).max() < 1e-9
    share = np.linspace(0, 1, 400)[None, :, None]
    longest = np.where(met, distance, 6.0)[:, None, None] * share * 0.9999
    on_the_way = P.rotate_inverse(place[3:], origins[:, None] + longest * along[:, None] - place[:3])
    assert outside(shape, on_the_way.reshape(-1, 3)).min() > -1e-9
    # the normal is the gradient: a step along it leaves the surface by as much
    step = P.rotate_inverse(place[3:], normal[met] * 1e-7)
    smooth = np.abs(outside(shape, end + step) - 1e-7) < 1e-12
    assert smooth.mean() > 0.99
    assert np.abs(np.linalg.norm(normal[met], axis=1) - 1).max() < 1e-12
    assert not normal[~met].any()


def test_distances_that_are_known() -> None:
    s = Sketch("known")
    s.ground()
    s.fixed("ball", Sphere(0.5), (2.0, 0.0, 1.0))
    s.fixed("can", Cylinder(0.5, 0.25), (0.0, 2.0, 1.0))
    s.fixed("pill", Capsule(0.25, 0.5), (0.0, 0.0, 3.0))
    scene = SceneGeometry(s.world())
    posed = scene.posed(scene.world.initial_body_pose[None])
    origins = [[0, 0, 1]] * 4 + [[2, 0, 1], [0.0, 0.0, 1.0], [0, 0, 1], [0.1, 2, 5]]
    directions = [[1, 0, 0], [0, 3, 0], [0, 0, 1], [0, 0, -0.1], [0, 0, 1], [0, -1, 0], [0.3, 0, -1], [0, 0, -1]]
    hits = scene.rays(posed, HERE[None], np.array(origins), np.array(directions), normals=True)
    slant = np.hypot(0.3, 1.0)
    assert hits.distance[0] == pytest.approx([1.5, 1.5, 1.25, 1.0, 0.5, np.inf, slant, 3.75], abs=1e-12)
    assert hits.geom[0].tolist() == [1, 2, 3, 0, 1, -1, 0, 2]
    known = [[-1, 0, 0], [0, -1, 0], [0, 0, -1], [0, 0, 1], [0, 0, 1], [0, 0, 0], [0, 0, 1], [0, 0, 1]]
    assert np.abs(hits.normal[0] - known).max() < 1e-12
    assert scene.segmentation[hits.geom[0]].tolist() == [1, 2, 3, 0, 1, 0, 0, 2]
    assert scene.body[hits.geom[0]].tolist() == [0, 1, 2, -1, 0, -1, -1, 1]


def test_a_plane_is_met_from_above_and_reach_ends_a_ray() -> None:
    s = Sketch("plane")
    s.ground()
    scene = SceneGeometry(s.world())
    posed = scene.posed(np.zeros((1, 0, 7)))
    up, down = np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, -1.0]])
    assert np.isinf(scene.rays(posed, HERE[None], down, up).distance).all()
    assert scene.rays(posed, HERE[None], up * 50, down, reach=50.0).distance == 50.0
    assert np.isinf(scene.rays(posed, HERE[None], up * 50, down, reach=49.999).distance).all()


def test_geoms_at_the_same_distance_the_first_of_the_world_counts() -> None:
    s = Sketch("twice")
    for name in "abc":
        s.fixed(name, Box((0.1, 0.1, 0.1)), (1.0, 0.0, 0.0))
    scene = SceneGeometry(s.world())
    posed = scene.posed(scene.world.initial_body_pose[None])
    ray = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]])
    assert scene.rays(posed, HERE[None], *ray).geom == 0
    assert scene.rays(posed, HERE[None], *ray, seen=scene.without([0])).geom == 1
    assert scene.rays(posed, HERE[None], *ray, seen=scene.on([2])).geom == 2


def test_a_mesh_is_met_as_by_trying_all_its_triangles() -> None:
    rng = np.random.default_rng(2)
    corners = rng.uniform(-0.5, 0.5, (300, 1, 3)) + rng.normal(size=(300, 3, 3)) * 0.1
    mesh = Mesh("soup", corners.reshape(-1, 3), np.arange(900, dtype=np.int32).reshape(-1, 3), "soup")
    world = replace(one(MeshShape("soup")), meshes=(mesh,))
    scene = SceneGeometry(world)
    origins, directions = aimed(rng, 1500)
    origins[:300] *= 0.1  # from inside too
    found = scene.rays(scene.posed(world.initial_body_pose[None]), HERE[None], origins, directions).distance[0]
    answer = worlds.ray_triangles(origins, P.normalize(directions), corners)
    assert np.isfinite(answer).sum() > 600
    assert (np.isfinite(answer) == np.isfinite(found)).all()
    met = np.isfinite(answer)
    assert np.abs(answer[met] - found[met]).max() < 1e-9


def test_no_ray_slips_between_two_triangles() -> None:
    """Rays through the corners and edges of a closed mesh, where rounding decides."""
    rng = np.random.default_rng(3)
    world = worlds.crowd(rng, 5, ground=False)
    mesh = world.meshes[0]
    world = replace(one(MeshShape(mesh.name)), meshes=(mesh,))
    scene = SceneGeometry(world)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    middles = (vertices[faces] + np.roll(vertices[faces], 1, axis=1)).reshape(-1, 3) / 2
    targets = np.concatenate([vertices, middles])
    origins = np.broadcast_to(vertices.mean(axis=0), targets.shape)
    hits = scene.rays(scene.posed(world.initial_body_pose[None]), HERE[None], origins, targets - origins)
    assert np.abs(hits.distance[0] - np.linalg.norm(targets - origins, axis=1)).max() < 1e-9


@pytest.mark.parametrize("count", [151, 400])
def test_the_tree_over_many_geoms_changes_no_bit(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(count)
    world = worlds.crowd(rng, count)
    poses = world.initial_body_pose[None]
    origins, directions = rng.uniform([-4, -4, 0.05], [4, 4, 3], (4000, 3)), rng.normal(size=(4000, 3))
    scene = SceneGeometry(world)
    posed = scene.posed(poses)
    assert posed.box.shape[1] > 0
    with_tree = scene.rays(posed, HERE[None], origins, directions, normals=True)
    near = scene.distances(posed, HERE[None], origins, normals=True)
    monkeypatch.setattr(module, "TREE_FROM", 10_000)
    flat = scene.posed(poses)
    assert flat.box.shape[1] == 0
    without = scene.rays(flat, HERE[None], origins, directions, normals=True)
    for a, b in zip(with_tree, without, strict=True):
        assert a.tobytes() == b.tobytes()
    for a, b in zip(near, scene.distances(flat, HERE[None], origins, normals=True), strict=True):
        assert a.tobytes() == b.tobytes()


def test_envs_have_what_is_present_in_them() -> None:
    """Of a slot that is one of two things, each env's own is met; what is absent is not there."""
    s = Sketch("slots")
    s.fixed("mug~1", Box((0.1, 0.1, 0.1)), (1.0, 0.0, 0.0))
    s.fixed("mug~2", Sphere(0.3), (1.0, 0.0, 0.0))
    world = with_slots(s.world(), {"mug": ("mug~1", "mug~2")})
    scene = SceneGeometry(world)
    present = np.concatenate([having(world, "mug~1"), having(world, "mug~2"), having(world)])
    posed = scene.posed(np.repeat(world.initial_body_pose[None], 3, axis=0), present)
    ray = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]])
    hits = scene.rays(posed, np.repeat(HERE[None], 3, axis=0), *ray)
    assert hits.distance[:, 0] == pytest.approx([0.9, 0.7, np.inf], abs=1e-12)
    near = scene.distances(posed, np.repeat(HERE[None], 3, axis=0), ray[0])
    assert near.distance[:, 0] == pytest.approx([0.9, 0.7, np.inf], abs=1e-12)
    nominal = scene.posed(world.initial_body_pose[None])
    assert scene.rays(nominal, HERE[None], *ray).distance == pytest.approx(0.9, abs=1e-12)


def test_the_tree_leaves_out_what_is_absent() -> None:
    rng = np.random.default_rng(6)
    world = worlds.crowd(rng, 170)
    names = [e.name for e in world.entities]
    world = with_slots(world, {f"slot{i}": tuple(names[2 * i : 2 * i + 2]) for i in range(85)})
    present = random_presence(world, rng, 3)
    scene = SceneGeometry(world)
    frames = np.repeat(HERE[None], 3, axis=0)
    origins, directions = rng.uniform([-4, -4, 0.05], [4, 4, 3], (2000, 3)), rng.normal(size=(2000, 3))
    posed = scene.posed(np.repeat(world.initial_body_pose[None], 3, axis=0), present)
    hits = scene.rays(posed, frames, origins, directions)
    for e in range(3):
        left_out = scene.without([i for i, entity in enumerate(world.body_entity) if not present[e, entity]])
        every = scene.posed(world.initial_body_pose[None], np.ones((1, len(names)), dtype=bool))
        alone = scene.rays(every, HERE[None], origins, directions, seen=left_out)
        assert alone.distance[0].tobytes() == hits.distance[e].tobytes()
        assert (alone.geom[0] == hits.geom[e]).all()


def test_visual_shapes_are_another_scene() -> None:
    s = Sketch("looks")
    s.fixed("wall", Box((0.1, 1.0, 1.0)), (1.0, 0.0, 0.0))
    world = s.world()
    hidden = replace(world, geoms=(replace(world.geoms[0], visible=False), replace(world.geoms[0], collides=False)))
    ray = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]])
    for shapes, geom in (("collision", 0), ("visual", 1)):
        scene = SceneGeometry(hidden, shapes)
        assert scene.rays(scene.posed(world.initial_body_pose[None]), HERE[None], *ray).geom == geom
    with pytest.raises(AnysimError, match="'collision' or 'visual' shapes, got 'both'"):
        SceneGeometry(world, "both")


def test_rays_and_frames_of_another_number_are_refused() -> None:
    s = Sketch("plane")
    s.ground()
    scene = SceneGeometry(s.world())
    posed = scene.posed(np.zeros((2, 0, 7)))
    with pytest.raises(AnysimError, match="1 frames for 2 envs"):
        scene.rays(posed, HERE[None], np.zeros((1, 3)), np.ones((1, 3)))
    with pytest.raises(AnysimError, match=r"\(rays, 3\) or \(2, rays, 3\), got \(3, 1, 3\)"):
        scene.rays(posed, np.repeat(HERE[None], 2, axis=0), np.zeros((3, 1, 3)), np.ones((3, 1, 3)))
    with pytest.raises(AnysimError, match=r"shape \(envs, 0, 7\), got \(2, 3, 7\)"):
        scene.posed(np.zeros((2, 3, 7)))


def test_rays_without_a_direction_or_an_origin_are_refused() -> None:
    scene = SceneGeometry(one(Sphere(0.1)))
    posed = scene.posed(scene.world.initial_body_pose[None])
    with pytest.raises(AnysimError, match="direction that is not zero"):
        scene.rays(posed, HERE[None], np.zeros((2, 3)), np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    with pytest.raises(AnysimError, match=r"as many origins as directions, got \(1, 2, 3\) and \(1, 1, 3\)"):
        scene.rays(posed, HERE[None], np.zeros((2, 3)), np.ones((1, 3)))


@pytest.mark.parametrize("count", [40, 200])
def test_an_env_whose_poses_are_no_numbers_costs_the_others_nothing(count: int) -> None:
    rng = np.random.default_rng(count)
    world = worlds.crowd(rng, count)
    scene = SceneGeometry(world)
    poses = np.repeat(world.initial_body_pose[None], 3, axis=0)
    poses[1, ::2] = np.nan
    poses[1, 1, 0] = np.inf
    frames = np.repeat(HERE[None], 3, axis=0)
    frames[1, 3:] = np.nan
    origins, directions = rng.uniform([-4, -4, 0.05], [4, 4, 3], (500, 3)), rng.normal(size=(500, 3))
    posed = scene.posed(poses)
    hits, near = scene.rays(posed, frames, origins, directions), scene.distances(posed, frames, origins)
    images = RayCamera(16, 16, 60.0).images(scene, posed, frames, normals=True, whole=True)
    states = occupancy(scene, posed, frames, Grid())
    assert np.isinf(hits.distance[1]).all()
    assert (images.geom[1] == -1).all()
    alone = scene.posed(poses[:1])
    for found, other in (
        (hits.distance, scene.rays(alone, HERE[None], origins, directions).distance),
        (near.distance, scene.distances(alone, HERE[None], origins).distance),
        (images.depth, RayCamera(16, 16, 60.0).images(scene, alone, HERE[None]).depth),
        (states, occupancy(scene, alone, HERE[None], Grid())),
    ):
        assert found[0].tobytes() == found[2].tobytes() == other[0].tobytes()


def test_a_world_without_shapes_is_empty() -> None:
    scene = SceneGeometry(World())
    posed = scene.posed(np.zeros((1, 0, 7)))
    assert np.isinf(scene.rays(posed, HERE[None], np.zeros((1, 3)), np.ones((1, 3))).distance).all()
    assert np.isinf(scene.distances(posed, HERE[None], np.zeros((1, 3))).distance).all()

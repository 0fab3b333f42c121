"""Costs of readings: rays, taxels, images, heights and grids, in processor time of one core."""

import time
from collections.abc import Callable
from math import radians
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.geometry.triangles import convex_hull
from anysim.math import pose as P
from anysim.model.world import (
    Body,
    BodyKind,
    Box,
    Capsule,
    Cylinder,
    Entity,
    EntityKind,
    Geom,
    HeightField,
    HeightFieldShape,
    Mesh,
    MeshShape,
    Plane,
    Shape,
    Sphere,
    World,
)
from anysim_sensors.camera import RayCamera
from anysim_sensors.heights import GroundHeights
from anysim_sensors.occupancy import Grid, occupancy
from anysim_sensors.patterns import grid, spinning
from anysim_sensors.scene import SceneGeometry

ENVS = (1, 4, 16, 64)


class SensorCost(NamedTuple):
    """One figure; `goal` is the least good one, or the greatest where `less` is better, None for none."""

    what: str
    value: float
    unit: str
    goal: float | None = None
    less: bool = False

    @property
    def missed(self) -> bool:
        """Whether the goal was missed."""
        return self.goal is not None and (self.value > self.goal if self.less else self.value < self.goal)

    @property
    def words(self) -> str:
        """The goal, as tables print it."""
        return "" if self.goal is None else f"{self.goal:g}" + " missed" * self.missed


def sensor_costs(geoms: int = 50, rounds: int = 30) -> list[SensorCost]:
    """Measure all of them in a scene of random shapes, the best of the rounds of each."""
    world = crowd(geoms)
    scene = SceneGeometry(world)
    return [
        *_lidar(scene, rounds),
        *_taxels(scene, rounds * 10),
        *_images(scene, rounds),
        _heights(rounds),
        _grid(scene, rounds),
    ]


def crowd(count: int) -> World:
    """Boxes, balls, capsules, cylinders and hulls in turn, fixed in a space of 8 m, on the ground."""
    rng = np.random.default_rng(0)
    bodies: list[Body] = []
    meshes: list[Mesh] = []
    geoms = [Geom("terrain", -1, Plane())]
    for i in range(count - 1):
        a, b, c = (float(v) for v in rng.uniform(0.05, 0.4, 3))
        shapes: list[Shape] = [Box((a, b, c)), Sphere(a), Capsule(a, b), Cylinder(a, b), MeshShape(f"hull{i}")]
        if i % 5 == 4:
            vertices, faces = convex_hull(rng.normal(size=(80, 3)) * [a, b, c], 64)
            meshes.append(Mesh(f"hull{i}", vertices, faces, f"crowd{i}"))
        x, y, z = (float(v) for v in rng.uniform([-4, -4, 0.3], [4, 4, 2.5]))
        qx, qy, qz, qw = (float(v) for v in P.normalize(rng.normal(size=4)))
        bodies.append(Body(f"thing{i}", BodyKind.STATIC, -1, (x, y, z), (qx, qy, qz, qw)))
        geoms.append(Geom(f"thing{i}", i, shapes[i % 5]))
    entities = tuple(Entity(b.name, EntityKind.OBJECT, i, i + 1, 0, 0) for i, b in enumerate(bodies))
    return World("crowd", bodies=tuple(bodies), geoms=tuple(geoms), entities=entities, meshes=tuple(meshes))


def best_of(rounds: int, work: Callable[[], object]) -> float:
    """Seconds of processor time of the best round."""
    work()
    found = np.inf
    for _ in range(rounds):
        begin = time.process_time()
        work()
        found = min(found, time.process_time() - begin)
    return found


def _frames(envs: int) -> Array:
    return np.repeat(np.array([[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]]), envs, axis=0)


def _poses(scene: SceneGeometry, envs: int) -> Array:
    return np.repeat(scene.world.initial_body_pose[None], envs, axis=0)


def _lidar(scene: SceneGeometry, rounds: int) -> list[SensorCost]:
    """A scan of 16 beams by 360 columns, and what an env costs among others, poses of the geoms included."""
    directions = spinning([radians(2 * i - 15) for i in range(16)], 360, 10.0).directions
    origins = np.zeros_like(directions)

    def scan(envs: int) -> Callable[[], object]:
        poses, frames = _poses(scene, envs), _frames(envs)
        return lambda: scene.rays(scene.posed(poses), frames, origins, directions, reach=100.0)

    each = [best_of(max(3, rounds * 4 // (4 + envs)), scan(envs)) / envs for envs in ENVS]
    words = ", ".join(map(str, ENVS))
    return [
        SensorCost("rays of a LiDAR, 5,760 in one env", len(directions) / each[0] / 1e6, "M/s", 3.0),
        SensorCost(
            f"an env's scan, the dearest of {words} envs to the cheapest", max(each) / min(each), "times", 1.25, True
        ),
    ]


def _taxels(scene: SceneGeometry, rounds: int) -> list[SensorCost]:
    """20 by 20 taxels of a pad that is pressed a millimetre into the first box of the scene."""
    x, y = (v.ravel() for v in np.meshgrid(*[np.linspace(-0.008, 0.008, 20)] * 2))
    pad = np.column_stack([x, y, np.zeros_like(x)])
    body = next(i for i, geom in enumerate(scene.world.geoms) if isinstance(geom.shape, Box))
    half = scene.world.geoms[body].shape
    assert isinstance(half, Box)
    place = scene.world.initial_body_pose[scene.world.geoms[body].body]
    frame = P.compose(place, P.pose((0.0, 0.0, half.half_size[2] - 0.001), (1.0, 0.0, 0.0, 0.0)))[None]
    posed = scene.posed(_poses(scene, 1))
    back, along = pad - [0.0, 0.0, 0.005], np.tile([0.0, 0.0, 1.0], (len(pad), 1))
    rays = best_of(rounds, lambda: scene.rays(posed, frame, back, along, reach=0.005))
    near = best_of(rounds, lambda: scene.distances(posed, frame, pad, reach=0.005))
    return [
        SensorCost("400 taxels by rays", rays * 1e6, "us", 20.0, True),
        SensorCost("400 taxels by signed distance", near * 1e6, "us", 20.0, True),
    ]


def _images(scene: SceneGeometry, rounds: int) -> list[SensorCost]:
    """A camera of 128 by 128 pixels that looks at twelve shapes, and one that looks at all of them."""
    few = SceneGeometry(crowd(12))
    eye = np.array([6.0, -5.0, 3.5])
    frame = P.pose(eye, P.look_at(eye, np.array([0.0, 0.0, 1.0])))[None]
    before = P.pose(np.add(eye, (0.05, 0.05, 0.0)), P.look_at(eye, np.array([0.0, 0.0, 1.0])))[None]
    camera = RayCamera(128, 128, 58.0, far=20.0)
    costs: list[SensorCost] = []
    for name, seen, goal in (("12", few, 1.0), (str(len(scene.all)), scene, None)):
        posed = seen.posed(_poses(seen, 1))

        def depths() -> object:
            return camera.images(seen, posed, frame)  # noqa: B023

        def channels() -> object:
            images = camera.images(seen, posed, frame, normals=True, whole=True)  # noqa: B023
            points = camera.points(images, frame)
            return points, camera.motion(seen, images, frame, posed, before, posed), camera.entities(images)  # noqa: B023

        where = f"128 x 128 pixels, {name} shapes"
        one, every = best_of(rounds, depths), best_of(rounds, channels)
        costs += [
            SensorCost(f"depth and segmentation, {where}", one * 1e3, "ms"),
            SensorCost(
                f"all channels: with normals, points, motion, what appeared, boxes, occlusion, {where}",
                every * 1e3,
                "ms",
                goal,
                True,
            ),
        ]
    return costs


def _heights(rounds: int) -> SensorCost:
    """187 points around each of 64 robots on a height field."""
    rng = np.random.default_rng(0)
    field = HeightField("hills", rng.uniform(-0.3, 0.3, (200, 200)), (20.0, 20.0))
    world = World(geoms=(Geom("terrain", -1, HeightFieldShape("hills")),), heightfields=(field,))
    ground, points = GroundHeights(world), grid((1.6, 1.0), 0.1)
    frames = np.column_stack([rng.uniform(-8, 8, (64, 3)), np.tile([0.0, 0.0, 0.6, 0.8], (64, 1))])
    seconds = best_of(rounds * 10, lambda: ground.at(frames, points))
    return SensorCost("samples of a height scan, 64 envs", 64 * len(points) / seconds / 1e6, "M/s", 100.0)


def _grid(scene: SceneGeometry, rounds: int) -> SensorCost:
    posed, frame = scene.posed(_poses(scene, 1)), _frames(1) - np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    seconds = best_of(rounds, lambda: occupancy(scene, posed, frame, Grid()))
    return SensorCost("an occupancy grid of 120 x 120 cells", seconds * 1e3, "ms")

"""Readings of the geometry module on engines: MuJoCo's own rays, and equal poses on three engines."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.conventions import WORLD
from anysim.engine.factory import create_simulation
from anysim.math import pose as P
from anysim.model.world import HeightField, HeightFieldShape, Plane, World
from anysim.testing import ground
from anysim.testing.engines import require_engine
from anysim_sensors.camera import RayCamera
from anysim_sensors.scene import SceneGeometry
from tests.plugins.sensors import worlds
from tests.plugins.sensors.worlds import HERE

WIDE = 1e3


def wide(world: World) -> World:
    """With a plane that MuJoCo's rays meet as far as ours: there it ends where it is no longer drawn."""
    geoms = [replace(g, shape=Plane(WIDE)) if isinstance(g.shape, Plane) else g for g in world.geoms]
    return replace(world, geoms=tuple(geoms))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("count", [60, 220])
def test_no_ray_of_five_thousand_is_a_millimetre_off_mujocos(seed: int, count: int) -> None:
    """From outside and inside of shapes, to the ground and past everything."""
    require_engine("mujoco")
    rng = np.random.default_rng(100 * count + seed)
    world = wide(worlds.crowd(rng, count))
    scene = SceneGeometry(world)
    origins = rng.uniform([-4, -4, 0.01], [4, 4, 3.0], (5000, 3))
    directions = P.normalize(rng.normal(size=(5000, 3)))
    with create_simulation("mujoco") as engine:
        engine.create_world(world)
        posed = scene.posed(engine.get_state().body_pose)
        theirs = engine.raycast(origins[None], directions[None])
    ours = scene.rays(posed, HERE[None], origins, directions)
    far = ours.distance[0] > WIDE  # nearly level rays that leave MuJoCo's plane
    assert far.sum() < 10 + np.isinf(ours.distance[0]).sum()
    met = np.isfinite(theirs.distance[0])
    assert 2500 < met.sum() < 5000
    assert (met == np.isfinite(ours.distance[0]))[~far].all()
    assert not met[np.isinf(ours.distance[0])].any()
    off = np.abs(ours.distance[0][met] - theirs.distance[0][met])
    hull = scene.geoms.mesh[scene.row[ours.geom[0]]][met] >= 0
    assert (off > 1e-3).sum() == 0
    assert off[~hull].max() < 1e-12
    assert hull.sum() > 200
    assert off[hull].max() < 1e-5  # MuJoCo keeps vertices in single precision
    same = scene.segmentation[ours.geom[0]] == theirs.entity[0]
    assert same[met].mean() > 0.999


def test_where_mujocos_rays_meet_other_things_than_ours() -> None:
    """A plane ends there where it is no longer drawn; a field has a base there, with sides, and is a sheet here."""
    require_engine("mujoco")
    origins = np.array([[0.0, 0.0, 1.0], [0.3, 0.2, -2.0], [3.0, 0.1, -0.32]])
    directions = np.array([[20.0, 0.0, -1.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
    hills = ground.hills(as_mesh=False)
    for world, row in ((worlds.crowd(np.random.default_rng(0), 0), 0), (hills, 1), (hills, 2)):
        ray = origins[[row]], directions[[row]]
        scene = SceneGeometry(world)
        with create_simulation("mujoco") as engine:
            engine.create_world(world)
            theirs = engine.raycast(*(v[None] for v in ray)).distance[0, 0]
            ours = scene.rays(scene.posed(engine.get_state().body_pose), HERE[None], *ray).distance[0, 0]
        if row == 0:
            assert np.isinf(theirs)
            assert ours == pytest.approx(np.hypot(20.0, 1.0))
        elif row == 1:
            assert ours == pytest.approx(2.0 + world.ground.heights_at(origins[1]))
            assert theirs < ours - 0.05  # the base
        else:
            assert theirs == pytest.approx(1.0, abs=1e-6)  # a side, below the field's lowest height
            assert np.isinf(ours)


def test_a_height_field_is_met_as_by_mujoco_from_above() -> None:
    require_engine("mujoco")
    world = ground.hills(as_mesh=False)
    rng = np.random.default_rng(1)
    origins = rng.uniform([-1.9, -1.4, 0.4], [1.9, 1.4, 2.0], (5000, 3))
    targets = rng.uniform([-1.9, -1.4, -0.3], [1.9, 1.4, -0.3], (5000, 3))
    scene = SceneGeometry(world)
    with create_simulation("mujoco") as engine:
        engine.create_world(world)
        theirs = engine.raycast(origins[None], (targets - origins)[None])
        ours = scene.rays(scene.posed(engine.get_state().body_pose), HERE[None], origins, targets - origins)
    assert np.isfinite(theirs.distance).all()
    assert np.abs(ours.distance - theirs.distance).max() < 1e-6


def test_equal_poses_on_three_engines_give_equal_readings() -> None:
    """Poses are written into each engine and read back; they are such as SAPIEN can have, in single precision."""
    rng = np.random.default_rng(5)
    world = worlds.crowd(rng, 20)
    poses = np.repeat(world.initial_body_pose[None], 2, axis=0)
    poses[..., :3] += rng.normal(size=poses[..., :3].shape) * 0.1
    poses[..., 3:] = P.normalize(rng.normal(size=poses[..., 3:].shape))
    origins, directions = rng.uniform([-4, -4, 0.05], [4, 4, 3], (3000, 3)), rng.normal(size=(3000, 3))
    frames = np.repeat(HERE[None], 2, axis=0)
    camera = RayCamera(64, 48, 60.0, far=20.0)
    eye = P.pose((3.0, -3.0, 2.5), P.look_at(np.array([3.0, -3.0, 2.5]), np.array([0.0, 0.0, 1.0])))
    readings = {}
    for name in ("sapien", "mujoco", "pybullet"):
        require_engine(name)
        with create_simulation(name) as engine:
            engine.create_world(world, 2)
            engine.set_body_state(pose=poses)
            poses = engine.get_state().body_pose
            scene = SceneGeometry(engine.world)
            posed = scene.posed(poses, engine.presence)
        rays = scene.rays(posed, frames, origins, directions)
        near = scene.distances(posed, frames, origins)
        images = camera.images(scene, posed, np.repeat(eye[None], 2, axis=0))
        readings[name] = (rays.distance, near.distance, images.distance)
    for name in ("mujoco", "pybullet"):
        for ours, theirs in zip(readings["sapien"], readings[name], strict=True):
            assert (np.isfinite(ours) == np.isfinite(theirs)).all()
            met = np.isfinite(ours)
            assert met.sum() > 0.3 * met.size
            assert np.abs(ours[met] - theirs[met]).max() < 1e-6, name


def test_a_tilted_field_is_where_its_frame_says() -> None:
    field = HeightField("slab", np.zeros((4, 4)), (2.0, 2.0))
    turn = P.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.array(0.3))
    base = ground.hills(as_mesh=False)
    geom = replace(
        base.geoms[0], shape=HeightFieldShape("slab"), body=WORLD, position=(0.0, 0.0, 1.0), quaternion=tuple(turn)
    )
    scene = SceneGeometry(replace(base, geoms=(geom,), heightfields=(field,)))
    posed = scene.posed(np.zeros((1, 0, 7)))
    origins = np.array([[0.5, 0.2, 5.0], [-0.5, 0.0, 5.0]])
    found = scene.rays(posed, HERE[None], origins, np.broadcast_to([0.0, 0.0, -1.0], (2, 3)), normals=True)
    assert found.distance[0] == pytest.approx([4 + 0.5 * np.tan(0.3), 4 - 0.5 * np.tan(0.3)], abs=1e-12)
    assert found.normal[0] == pytest.approx(np.tile([np.sin(0.3), 0.0, np.cos(0.3)], (2, 1)), abs=1e-12)

"""Ray cameras: images as the reference has them, and the channels that follow from them."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.engine.cameras import CameraView
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.model.world import Box, Plane, Sphere
from anysim.testing.sketch import Sketch
from anysim_parity.sight import focal_length, project, sight
from anysim_sensors.camera import RayCamera
from anysim_sensors.presets import CAMERAS, camera_preset
from anysim_sensors.scene import SceneGeometry
from tests.plugins.sensors import worlds

W, H, FOV = 96, 64, 55.0


def looking(eye, target) -> np.ndarray:
    return P.pose(np.array(eye), P.look_at(np.array(eye), np.array(target)))


def test_depth_and_segmentation_are_those_of_the_reference() -> None:
    """`anysim_parity.sight` is another program: in arrays, shape by shape, without trees."""
    rng = np.random.default_rng(3)
    world = worlds.crowd(rng, 30)
    scene = SceneGeometry(world, "visual")
    pose = looking((6.0, -5.0, 3.5), (0.0, 0.0, 1.0))
    camera = RayCamera(W, H, FOV, far=12.0)
    images = camera.images(scene, scene.posed(world.initial_body_pose[None]), pose[None])
    view = CameraView("eye", pose[None], np.array([FOV]), world.initial_body_pose[None], W, H, 0.01, 12.0)
    flat = tuple(replace(g, shape=Plane(1e3)) if g.name == "terrain" else g for g in world.geoms)
    answer = sight(replace(world, geoms=flat), world.initial_body_pose, view)
    assert (images.segmentation[0] == answer.segmentation).all()
    seen = np.isfinite(answer.depth)
    assert 0.5 < seen.mean() < 1
    assert (np.isfinite(images.depth[0]) == seen).all()
    assert np.abs(images.depth[0][seen] - answer.depth[seen]).max() < 2e-6  # float32 at 12 m
    assert images.depth.dtype == np.float32


@pytest.mark.parametrize("whole", [False, True])
def test_pixels_are_the_rays_of_the_scene_to_the_bit(whole: bool) -> None:
    """A camera tries each geom where it may be seen alone, some of them behind it or across its plane."""
    rng = np.random.default_rng(4)
    world = worlds.crowd(rng, 170)
    scene = SceneGeometry(world)
    eyes = [looking((0.3, -0.2, 1.0), (1.0, 2.0, 0.8)), looking((-5.0, 3.0, 4.0), (0.0, 0.0, 0.5))]
    frames = np.stack(eyes)
    posed = scene.posed(np.repeat(world.initial_body_pose[None], 2, axis=0))
    camera = RayCamera(W, H, FOV)
    images = camera.images(scene, posed, frames, normals=True, whole=whole)
    hits = scene.rays(posed, frames, np.zeros((W * H, 3)), camera.directions[0], normals=True)
    assert images.distance.tobytes() == hits.distance.tobytes()
    assert images.geom.tobytes() == hits.geom.tobytes()
    assert images.normal.tobytes() == hits.normal.tobytes()


def scene_of(ball=(0.0, 0.0, 1.0), box=(-1.0, 0.0, 1.0)):
    s = Sketch("two")
    s.ground()
    s.free("ball", Sphere(0.3), ball)
    s.free("box", Box((0.2, 0.6, 0.6)), box)
    return SceneGeometry(s.world(), "visual")


def test_points_and_normals_are_on_the_surfaces() -> None:
    scene = scene_of()
    posed = scene.posed(scene.world.initial_body_pose[None])
    frame = looking((4.0, 0.5, 2.0), (0.0, 0.0, 1.0))[None]
    camera = RayCamera(W, H, FOV)
    images = camera.images(scene, posed, frame, normals=True)
    points = camera.points(images, frame)[0]
    ball = images.segmentation[0] == 1
    assert ball.sum() > 50
    assert np.abs(np.linalg.norm(points[ball] - [0, 0, 1], axis=1) - 0.3).max() < 1e-6
    assert np.abs((points[ball] - [0, 0, 1]) / 0.3 - images.normal[0][ball]).max() < 1e-5
    floor = images.geom[0] == 0
    assert np.abs(points[floor][:, 2]).max() < 1e-5
    nothing = images.geom[0] < 0
    assert nothing.sum() > 50
    assert np.isnan(points[nothing]).all()
    assert np.isinf(images.depth[0][nothing]).all()


def test_flow_is_where_points_have_come_from() -> None:
    """The ball moves and turns, the camera moves too; checked point by point with the reference's projection."""
    scene = scene_of()
    before = scene.world.initial_body_pose.copy()
    after = before.copy()
    after[0] = P.pose((0.1, 0.15, 1.05), P.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(0.4)))
    eyes = looking((4.0, 0.5, 2.0), (0.0, 0.0, 1.0)), looking((4.1, 0.4, 2.0), (0.0, 0.1, 1.0))
    camera = RayCamera(W, H, FOV)
    old, new = scene.posed(before[None]), scene.posed(after[None])
    images = camera.images(scene, new, eyes[1][None])
    flow = camera.motion(scene, images, eyes[1][None], new, eyes[0][None], old).flow[0]
    points = camera.points(images, eyes[1][None])[0].astype(float)
    view = CameraView("eye", eyes[0][None], np.array([FOV]), before[None], W, H, 0.01, 100.0)
    u, v = np.meshgrid(np.arange(W), np.arange(H))
    for number, body in ((1, 0), (2, 1), (0, None)):
        mask = (images.segmentation[0] == number) & (images.geom[0] >= 0)
        was = points[mask]
        if body is not None:
            was = P.compose(before[body], P.compose(P.inverse(after[body]), with_turn(was)))[:, :3]
        pixel = project(was, view) - 0.5
        answer = np.column_stack([u[mask], v[mask]]) - pixel
        assert mask.sum() > 50
        assert np.abs(flow[mask] - answer).max() < 1e-3
    assert np.isnan(flow[images.geom[0] < 0]).all()


def with_turn(points: np.ndarray) -> np.ndarray:
    return np.column_stack([points, np.tile([0.0, 0.0, 0.0, 1.0], (len(points), 1))])


def test_boxes_and_how_much_is_hidden() -> None:
    """The ball hides the middle of the box; alone, the box has the pixels that are counted for it."""
    scene = scene_of()
    posed = scene.posed(scene.world.initial_body_pose[None])
    frame = looking((4.0, 0.0, 1.0), (0.0, 0.0, 1.0))[None]
    camera = RayCamera(W, H, FOV)
    images = camera.images(scene, posed, frame, whole=True)
    found = camera.entities(images)
    for number in (1, 2):
        rows, columns = np.nonzero(images.segmentation[0] == number)
        assert found.box[0, number].tolist() == [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        assert found.visible[0, number] == len(rows)
        alone = camera.images(scene, posed, frame, seen=scene.on([number - 1]))
        assert images.whole[0, number] == (alone.segmentation[0] == number).sum()
    assert found.occlusion[0, 1] == 0.0
    hidden = (np.pi * 0.3**2 / 16) / (1.2 * 1.2 / 4.8**2)  # solid angles, about
    assert found.occlusion[0, 2] == pytest.approx(hidden, rel=0.1)
    assert np.isnan(found.occlusion[0, 0])
    with pytest.raises(AnysimError, match="draw them with whole=True"):
        camera.entities(camera.images(scene, posed, frame))


def test_near_and_far_are_along_the_axis() -> None:
    scene = scene_of()
    posed = scene.posed(scene.world.initial_body_pose[None])
    frame = looking((4.0, 0.0, 1.0), (0.0, 0.0, 1.0))[None]
    near = RayCamera(W, H, FOV, near=3.8, far=4.79).images(scene, posed, frame)
    assert near.geom[0, H // 2, W // 2] == -1  # the ball begins at 3.7 and hides what is behind it
    assert 2 not in near.segmentation  # the front of the box is at 4.8, everywhere
    assert 2 in RayCamera(W, H, FOV, near=3.8, far=4.81).images(scene, posed, frame).segmentation


def test_fields_of_view_may_differ_between_envs() -> None:
    scene = scene_of()
    posed = scene.posed(np.repeat(scene.world.initial_body_pose[None], 2, axis=0))
    frames = np.repeat(looking((4.0, 0.0, 1.0), (0.0, 0.0, 1.0))[None], 2, axis=0)
    both = RayCamera(W, H, [40.0, 70.0]).images(scene, posed, frames)
    for e, fov in enumerate((40.0, 70.0)):
        alone = scene.posed(scene.world.initial_body_pose[None])
        assert both.depth[e].tobytes() == RayCamera(W, H, fov).images(scene, alone, frames[:1]).depth[0].tobytes()
    assert RayCamera(W, H, 40.0).focal[0] == pytest.approx(focal_length(40.0, H))


@pytest.mark.parametrize("name", CAMERAS)
def test_presets_are_cameras(name: str) -> None:
    preset = camera_preset(name)
    camera = RayCamera(preset.width // 8, preset.height // 8, preset.fov, preset.near, preset.far)
    across = 2 * np.degrees(np.arctan(preset.width / 2 / (camera.focal[0] * 8)))
    assert 65 < across < 90
    assert preset.source


@pytest.mark.parametrize("count", [30, 170])
def test_what_appeared_is_what_rays_from_where_the_camera_was_do_not_reach(count: int) -> None:
    """Everything moves and the camera too; each point is asked for alone, in the scene as it was."""
    rng = np.random.default_rng(5)
    world = worlds.crowd(rng, count)
    scene = SceneGeometry(world)
    after = world.initial_body_pose.copy()
    before = P.compose(
        after, P.pose(rng.normal(0, 0.1, (len(after), 3)), P.normalize(np.tile([0, 0.1, 0, 1.0], (len(after), 1))))
    )
    frames, stood = (looking(eye, (0.0, 0.0, 1.0))[None] for eye in ((5.0, -4.0, 2.5), (4.8, -3.9, 2.4)))
    new, old = scene.posed(after[None]), scene.posed(before[None])
    camera, seen = RayCamera(W, H, FOV, near=0.5, far=9.0), scene.without([3, 4])
    images = camera.images(scene, new, frames, seen=seen)
    moved = camera.motion(scene, images, frames, new, stood, old, seen=seen)
    there = images.geom[0] >= 0
    body = scene.body[images.geom[0]][there]
    point = P.compose(frames, with_turn(images.distance[0][there][:, None] * camera.directions[0][there.ravel()]))
    was = P.compose(before[body], P.compose(P.inverse(after[body]), point))
    was[body < 0] = point[body < 0]
    local = P.rotate_inverse(np.broadcast_to(stood[0, 3:], (len(was), 4)), was[:, :3] - stood[0, :3])
    length = np.linalg.norm(local, axis=1)
    hits = scene.rays(old, stood, np.zeros_like(local), local, seen=seen).distance[0]
    across = np.abs(local[:, :2] / local[:, 2:]) * camera.focal
    inside = (local[:, 2] >= 0.5) & (local[:, 2] <= 9.0) & (across <= (W / 2, H / 2)).all(axis=1)
    answer = ~(inside & (hits >= length - 1e-4))
    assert (moved.appeared[0][there] == answer).all()
    assert not moved.appeared[0][~there].any()
    assert 0.02 < (answer & inside).mean() < 0.5, "some were hidden"
    assert (~inside).any(), "and some out of the image"
    assert len(camera.motion(scene, images, frames, new, stood, old, appeared=False).appeared) == 0

"""The camera layer: images held against the geometry find the camera that is wrong, and the picture is right."""

from dataclasses import replace

import numpy as np
import pytest

from anysim import compile_world
from anysim.engine.cameras import CameraView
from anysim.math import pose as P
from anysim.model.world import Box, Camera, Capsule, Cylinder, Geom, Sphere, World
from anysim.testing import worlds
from anysim.testing.engines import require_drawing
from anysim.testing.kinematic import NullEngine
from anysim_mujoco.engine import MujocoEngine
from anysim_parity.camera import alone, bent, camera_layer, middle
from anysim_parity.judge import agreement, outside
from anysim_parity.pictures import depth_picture, segmentation_picture
from anysim_parity.sight import project, sight
from anysim_parity.variants import nominal_population


class Sideways(MujocoEngine):
    """Looks through the corners of its pixels."""

    def _render(self, view, ids, channels):
        half = np.array([0.5, 0.5]) / (view.height / 2 / np.tan(np.radians(view.fov[0]) / 2))
        pose = view.pose.copy()
        turn = P.from_axis_angle(np.array([0.0, 1.0, 0.0]), -half[0])
        pose[:, 3:] = P.multiply(pose[:, 3:], np.broadcast_to(turn, pose[:, 3:].shape))
        return super()._render(replace(view, pose=pose), ids, channels)


class Behind(MujocoEngine):
    """Its camera is 2 cm behind its place."""

    def _render(self, view, ids, channels):
        pose = view.pose.copy()
        pose[:, :3] -= 0.02 * P.rotate(pose[:, 3:], np.array([0.0, 0.0, 1.0]))
        return super()._render(replace(view, pose=pose), ids, channels)


@pytest.fixture
def drawn() -> None:
    require_drawing(MujocoEngine)


def zoo() -> World:
    """Every primitive, turned, before a wall."""
    world = worlds.wall()
    turned = tuple(float(v) for v in P.normalize(np.array([0.3, -0.2, 0.5, 0.8])))
    shapes = (Sphere(0.12), Cylinder(0.08, 0.15), Capsule(0.06, 0.12), Box((0.1, 0.06, 0.12)))
    geoms = [
        Geom(f"extra{i}", body, shape, (-0.1, 0.0, height), turned)
        for i, (shape, body, height) in enumerate(zip(shapes, (3, 3, 4, 4), (0.2, -0.2, 0.2, -0.2), strict=True))
    ]  # on the red and the green cube
    return replace(world, geoms=(*world.geoms, *geoms))


def test_the_drawn_scene_is_the_scene(drawn: None) -> None:
    """MuJoCo sees every primitive where the rays meet it, to a tenth of a millimetre."""
    layer = camera_layer(zoo(), {"mujoco": MujocoEngine}, size=(160, 120))
    assert not layer.refused
    judged = [m for m in layer.measures if m.tolerance is not None]
    assert len(judged) > 8
    for m in judged:
        assert agreement(m), m
        assert m.values["mujoco"] < {"m": 1e-4, "": 0.03, "px": 0.1}[m.unit], m


def test_it_finds_a_camera_that_looks_through_corners(drawn: None) -> None:
    """Half a pixel aside: the middles of things are off."""
    layer = camera_layer(worlds.wall(), {"right": MujocoEngine, "wrong": Sideways}, size=(320, 240), moved=False)
    middles = [m for m in layer.measures if "middle of red" in m.subject]
    assert middles
    for m in middles:
        assert outside(m) == ("wrong",), m
        assert m.values["wrong"] == pytest.approx(0.5, abs=0.1)


def test_it_finds_a_camera_that_stands_elsewhere(drawn: None) -> None:
    """Two centimetres back: depths are off by as much, for one engine and between the two."""
    layer = camera_layer(worlds.wall(), {"right": MujocoEngine, "wrong": Behind}, size=(160, 120), moved=False)
    depths = [m for m in layer.measures if "depth" in m.subject and "median" in m.subject]
    assert depths
    for m in depths:
        assert outside(m) == ("wrong",)
        assert m.values["wrong"] == pytest.approx(0.02, abs=1e-3)
    gaps = [g for g in layer.gaps if g.subject.endswith("depth, median")]
    assert all(g.tolerance is not None and g.value > g.tolerance for g in gaps)


def test_pictures_are_there_for_people(drawn: None) -> None:
    layer = camera_layer(worlds.scene(), {"mujoco": MujocoEngine}, size=(64, 48))
    kinds = [p.title.rpartition(": ")[2] for p in layer.pictures]
    assert kinds == ["colour", "depth", "segmentation"] * 2
    for picture in layer.pictures:
        assert picture.title.startswith("camera default, ")
        assert picture.pixels.shape == (48, 64, 3)
        assert picture.pixels.dtype == np.uint8
        assert picture.pixels.std() > 1.0


def test_an_engine_that_cannot_draw_is_named(drawn: None) -> None:
    class Blind(MujocoEngine):
        def _render(self, *_):
            raise ValueError("no light")

    layer = camera_layer(worlds.wall(), {"null": NullEngine, "blind": Blind, "mujoco": MujocoEngine}, size=(32, 24))
    assert layer.refused["null"].startswith("null does not declare render: rgb")
    assert layer.refused["blind"] == "ValueError: no light"
    assert all(set(m.values) <= {"mujoco"} for m in layer.measures)


# ---------------------------------------------------------------------- the ray reference, without any engine


def view_from(eye: tuple[float, float, float], target: tuple[float, float, float], size: tuple[int, int]) -> CameraView:
    pose = np.array([[*eye, *P.look_at(np.array(eye), np.array(target))]])
    return CameraView("eye", pose, np.array([60.0]), np.zeros((len(pose), 0, 7)), *size, 0.01, 20.0)


def test_rays_know_the_answer() -> None:
    """A wall across the view has one depth; a ball is nearest in its middle, which is where a pinhole puts it."""
    world = World(
        geoms=(
            Geom("wall", -1, Box((0.05, 5.0, 5.0)), (2.05, 0.0, 0.0)),
            Geom("ball", -1, Sphere(0.2), (1.2, 0.0, 0.0)),
        ),
        cameras=(Camera("eye", -1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), 60.0, 65, 49),),
    )
    seen = sight(world, np.zeros((0, 7)), view_from((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (65, 49)))
    assert seen.depth[0, 0] == pytest.approx(2.0, abs=1e-12)
    assert seen.depth[24, 32] == pytest.approx(1.0, abs=1e-12)
    mask = seen.depth < 1.9
    assert middle(mask) == pytest.approx([32.5, 24.5], abs=1e-9)


def test_a_point_is_projected_where_its_pixel_is() -> None:
    view = view_from((1.0, -2.0, 0.5), (0.0, 0.0, 0.3), (320, 240))
    points = np.array([[0.0, 0.0, 0.3], [0.3, 0.1, 0.2]])
    pixels = project(points, view)
    assert pixels[0] == pytest.approx([160.0, 120.0], abs=1e-9)
    world = World(geoms=(Geom("ball", -1, Sphere(0.02), tuple(points[1].tolist())),))
    mask = np.isfinite(sight(world, np.zeros((0, 7)), view).depth)
    assert middle(mask) == pytest.approx(pixels[1], abs=0.2)


def test_pictures_and_overlaps() -> None:
    a, b = np.zeros((4, 4), dtype=bool), np.zeros((4, 4), dtype=bool)
    a[:2], b[1:3] = True, True
    assert alone(a, b) == pytest.approx(2 / 3)
    assert np.isnan(alone(a & False, a & False))
    near, far = depth_picture(np.array([[0.5, 2.0], [np.inf, 1.0]]), 0.5, 2.0)[0]
    assert near.sum() > far.sum()
    colors = segmentation_picture(np.arange(9).reshape(3, 3))
    assert len(np.unique(colors.reshape(-1, 3), axis=0)) == 9


def test_the_second_state_is_another_within_the_limits() -> None:
    world = worlds.gripper()
    state = bent(world)
    start = np.array([j.initial for j in world.joints])
    assert (state.joints != start).all()
    assert state.joints[1] == pytest.approx(0.5 * state.joints[0] + 0.01)
    for joint, value in zip(world.joints, state.joints, strict=True):
        assert joint.lower <= value <= joint.upper


def test_what_varies_is_drawn_as_what_it_is_before_anything_is_drawn() -> None:
    ball, brick = {"sphere": 0.05}, {"box": [0.1, 0.1, 0.2]}
    objects = {
        "mug": {"source": {"choice": [ball, brick], "otherwise": brick, "ratio": 0.5}},
        "cube": {"source": ball, "count": {"range": [0, 2]}},
    }
    made = compile_world({"world": {"objects": objects, "cameras": {"c": {"from": [1, 1, 1], "look_at": "mug"}}}})
    plain = nominal_population(made)
    assert [entity.name for entity in plain.entities] == ["mug~1", "cube_0"]
    assert (plain.slots, plain.cameras[0].look_at) == ((), "mug~1")

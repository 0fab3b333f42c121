"""Annotations of boxes before a camera, whose numbers follow from a sketch on paper."""

from typing import Any

import numpy as np
import pytest

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import AnysimError, PluginError, SpecError
from anysim.math import pose as P
from anysim_annotation import channels, lens
from anysim_annotation.capture import Capture
from anysim_annotation.orders import read_orders
from anysim_annotation.view import Source
from anysim_sensors.camera import Images, RayCamera
from tests.plugins.annotation.scenes import AHEAD, EYE, FOCAL, FOV, H, W, boxes, label, looking_at, moment

FACE = 1.8
WIDE = ("wide", (0.2, 0.3, 0.1), (2.0, 0.0, 1.0))
SMALL = ("small", (0.05, 0.1, 0.1), (1.05, 0.0, 1.0))


def pixels(half: float, size: int, away: float = FACE) -> list[int]:
    """First pixel and the one after the last whose centres are within `half` [m] of the middle, `away` [m] from it."""
    reach = FOCAL * half / away
    inside = np.abs(np.arange(size) + 0.5 - size / 2) < reach
    return [int(np.argmax(inside)), int(size - np.argmax(inside[::-1]))]


def test_a_box_has_the_pixels_that_its_face_covers() -> None:
    [[box]] = label(looking_at(boxes(WIDE)), "boxes_2d")["boxes_2d"].records
    (left, right), (top, bottom) = pixels(0.3, W), pixels(0.1, H)
    assert box["box"] == [left, top, right, bottom]
    assert box["visible"] == (right - left) * (bottom - top)
    assert (box["id"], box["name"], box["occlusion"]) == (1, "wide", 0.0)


def test_what_stands_before_it_hides_as_many_pixels() -> None:
    engine = looking_at(boxes(WIDE, SMALL))
    wide, small = label(engine, "boxes_2d")["boxes_2d"].records[0]
    (left, right), (top, bottom) = pixels(0.1, W, 1.0), pixels(0.1, H, 1.0)
    assert small["box"] == [left, top, right, bottom]
    (a, b), (c, d) = pixels(0.3, W), pixels(0.1, H)
    hidden = (min(right, b) - max(left, a)) * (min(bottom, d) - max(top, c))
    assert wide["visible"] == (b - a) * (d - c) - hidden
    assert wide["occlusion"] == pytest.approx(hidden / ((b - a) * (d - c)), abs=1e-6)
    assert small["occlusion"] == 0.0


def test_depth_normals_and_points_are_those_of_the_face() -> None:
    found = label(looking_at(boxes(WIDE)), "depth", "normals", "point_cloud", "instance", "semantic")
    seen = found["instance"].arrays["instance"][0] == 1
    depth, normals = found["depth"].arrays["depth"][0], found["normals"].arrays["normals"][0]
    assert np.abs(depth[seen] - FACE).max() < 1e-6
    assert np.isinf(depth[~seen]).all()
    assert np.abs(normals[seen] - [-1.0, 0.0, 0.0]).max() < 1e-6
    assert np.isnan(normals[~seen]).all()
    cloud = {name: rows[0] for name, rows in found["point_cloud"].arrays.items()}
    assert len(cloud["world"]) == seen.sum()
    assert np.abs(cloud["world"][:, 0] - FACE).max() < 1e-6
    assert np.abs(cloud["world"][:, 1]).max() < 0.3
    assert (
        np.abs(
            cloud["camera"] - np.column_stack([-cloud["world"][:, 1], 1 - cloud["world"][:, 2], cloud["world"][:, 0]])
        ).max()
        < 1e-6
    )
    assert seen[cloud["pixel"][:, 1], cloud["pixel"][:, 0]].all()
    assert (found["semantic"].arrays["semantic"][0] == seen).all()


def test_a_turned_box_in_space_has_its_corners_where_they_project() -> None:
    world = boxes(WIDE)
    engine = looking_at(world)
    turn = P.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(0.5))
    poses = P.pose((2.0, 0.2, 1.1), turn)[None]
    capture = Capture(engine, {"eye": ["boxes_3d", "camera"]}, "geometry")
    found = capture.take(moment(poses))["eye"]
    [[box]], [[camera]] = found["boxes_3d"].records, found["camera"].records
    assert np.abs(box["pose"] - poses[0]).max() < 1e-12
    assert np.abs(box["size"] - [0.4, 0.6, 0.2]).max() < 1e-12
    local = P.rotate_inverse(np.broadcast_to(turn, (8, 4)), box["corners"] - poses[0, :3])
    assert np.abs(np.abs(local) - [0.2, 0.3, 0.1]).max() < 1e-12
    flat = np.array(camera["extrinsics"]) @ np.column_stack([box["corners"], np.ones(8)]).T
    image = np.array(camera["intrinsics"]) @ flat[:3]
    assert np.abs((image[:2] / image[2]).T - box["pixels"]).max() < 1e-9
    assert np.abs(image[2] - box["depth"]).max() < 1e-12
    assert camera["intrinsics"][0][0] == pytest.approx(FOCAL)
    assert box["inside"]


def test_what_is_behind_the_camera_has_no_pixel() -> None:
    seen = lens.project(
        np.array([[[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0]]]), P.pose(EYE, P.look_at(EYE, AHEAD))[None], np.array([FOV]), W, H
    )
    assert np.isnan(seen.pixel[0, 0]).all()
    assert seen.inside.tolist() == [[False, True]]
    assert seen.pixel[0, 1].tolist() == [W / 2, H / 2]


def test_flow_is_the_motion_of_the_face_and_says_what_was_hidden() -> None:
    """The box comes from the left by 0.12 m; of the wall behind, a strip comes out of its shadow."""
    wall = ("wall", (0.1, 3.0, 3.0), (3.1, 0.0, 1.0))
    engine = looking_at(boxes(WIDE, wall))
    capture = Capture(engine, {"eye": ["flow", "instance"]}, "geometry")
    poses = engine.world.initial_body_pose.copy()
    first = capture.take(moment(poses))["eye"]["flow"].arrays
    assert np.isnan(first["flow"][0]).all()
    assert first["occluded"][0].all()
    before = capture.take(moment(poses, 1))["eye"]
    assert np.nanmax(np.abs(before["flow"].arrays["flow"][0])) < 1e-5
    assert not before["flow"].arrays["occluded"][0].any()
    poses[0, 1] -= 0.12
    found = capture.take(moment(poses, 2))["eye"]
    flow, occluded = (found["flow"].arrays[name][0] for name in ("flow", "occluded"))
    now, then = (rows["instance"].arrays["instance"][0] for rows in (found, before))
    box = now == 1
    assert np.abs(flow[box] - [FOCAL * 0.12 / FACE, 0.0]).max() < 1e-5
    assert np.abs(flow[~box]).max() < 1e-5
    assert (occluded[~box] == (then[~box] == 1)).all()
    assert 0 < occluded.sum() < 60
    assert not occluded[box].any()


def test_a_new_episode_has_no_frame_before_it() -> None:
    engine = looking_at(boxes(WIDE), 2)
    capture = Capture(engine, {"eye": ["flow"]}, "geometry")
    capture.take()
    capture.begin([1])
    flow = capture.take()["eye"]["flow"].arrays["flow"]
    assert np.isfinite(flow[0]).any()
    assert not np.isfinite(flow[1]).any()


def test_nothing_is_drawn_that_no_annotator_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = looking_at(boxes(WIDE))
    monkeypatch.setattr(type(engine), "render", lambda *_, **__: pytest.fail("the engine drew"))
    capture = Capture(engine, {"eye": ["boxes_3d", "camera"]}, "engine")
    monkeypatch.setattr("anysim_sensors.camera.RayCamera.images", lambda *_, **__: pytest.fail("rays were cast"))
    assert len(capture.take()["eye"]["boxes_3d"].records[0]) == 1


@pytest.mark.parametrize(
    ("name", "drawn", "made"),
    [
        ("camera", (), set()),
        ("boxes_3d", (), set()),
        ("depth", ("depth",), set()),
        ("instance", ("segmentation",), set()),
        ("semantic", ("segmentation",), set()),
        ("boxes_2d", ("segmentation",), {"rays", "whole"}),
        ("point_cloud", ("depth", "segmentation"), {"points"}),
        ("normals", ("depth", "segmentation"), {"normals"}),
        ("flow", ("depth", "segmentation"), {"moved", "rays", "bodies"}),
    ],
)
@pytest.mark.parametrize("source", ["engine", "geometry"])
def test_an_annotator_costs_what_it_needs_and_no_more(
    name: str, drawn: tuple[str, ...], made: set[str], source: Source, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the engine is asked to draw, which rays are cast and which channels are computed, in two steps."""
    engine = looking_at(boxes(WIDE))
    found, asked = set[str](), list[tuple[str, ...]]()
    real = {part: getattr(channels, part) for part in ("normals", "points", "moved", "bodies")}
    for part, make in real.items():
        monkeypatch.setattr(channels, part, lambda view, part=part, make=make: found.add(part) or make(view))
    images = RayCamera.images

    def cast(self: RayCamera, *args: Any, normals: bool = False, whole: bool = False, **more: Any) -> Images:
        found.update(["rays", *["exact normals"] * normals, *["whole"] * whole])
        return images(self, *args, normals=normals, whole=whole, **more)

    def draw(_: SimEngine, __: str, channels: tuple[str, ...], **___: Any) -> dict[str, Array]:
        asked.append(tuple(channels))
        kinds = {"depth": np.float32, "segmentation": np.int32}
        return {channel: np.ones((1, H, W), dtype=kinds[channel]) for channel in channels}

    monkeypatch.setattr(RayCamera, "images", cast)
    monkeypatch.setattr(type(engine), "render", draw)
    capture = Capture(engine, {"eye": [name]}, source)
    for _ in range(2):
        capture.take()
    if source == "engine":
        assert asked == [drawn] * 2 * bool(drawn)
        assert found == made
    else:
        assert asked == []
        rays = {"rays"} if drawn else set[str]()
        assert found == made | rays | ({"exact normals"} if name == "normals" else set[str]())


def test_what_several_need_is_computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    from anysim_sensors.camera import RayCamera

    drawn, real = [], RayCamera.images
    monkeypatch.setattr(RayCamera, "images", lambda self, *a, **k: drawn.append(1) or real(self, *a, **k))
    label(looking_at(boxes(WIDE)), "boxes_2d", "depth", "normals", "point_cloud", "instance", "semantic", "flow")
    assert len(drawn) == 1


def test_labels_of_an_env_do_not_depend_on_the_others() -> None:
    names = ("boxes_2d", "boxes_3d", "camera", "depth", "normals", "point_cloud", "instance")
    alone, many = (label(looking_at(boxes(WIDE, SMALL), count), *names) for count in (1, 3))
    for name in names:
        for key, rows in alone[name].arrays.items():
            assert rows[0].tobytes() == many[name].arrays[key][2].tobytes()
        assert str(alone[name].records[0]) == str(many[name].records[2])


def test_orders_are_checked_with_their_keys() -> None:
    assert read_orders("boxes_2d, normals") == {"boxes_2d": {}, "normals": {}}
    assert read_orders("{point_cloud: {stride: 2}}") == {"point_cloud": {"stride": 2}}
    with pytest.raises(PluginError, match="no annotator named 'boxes' is installed; did you mean 'boxes_"):
        read_orders("boxes")
    with pytest.raises(SpecError, match=r"annotate.point_cloud.stride: must be at least 1"):
        read_orders("{point_cloud: {stride: 0}}")
    with pytest.raises(SpecError, match="names no annotator"):
        read_orders(",")


def test_a_channel_that_was_not_declared_is_refused() -> None:
    capture = Capture(looking_at(boxes(WIDE)), {"eye": ["camera"]}, "geometry")
    seen = []
    annotator = capture.annotators("eye")["camera"]
    annotator.annotate, real = lambda view: seen.append(view) or real(view), annotator.annotate
    capture.take()
    with pytest.raises(AnysimError, match="the channel 'depth' was not declared; name it in `needs`"):
        seen[0]["depth"]

"""The exporter `foxglove`: shapes, scans, drawings on images, videos."""

from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations

import anysim
from anysim.errors import RecordError
from anysim.math import pose as P
from anysim.record.header import StreamInfo
from anysim.record.reader import TrajectoryReader, open_trajectory
from anysim.record.streams import StreamRow
from anysim_export.job import export
from anysim_mcap.foxglove.marks import has_marks, marks
from anysim_mcap.foxglove.scans import Rays, scan_message
from anysim_mcap.foxglove.scene import scene_update
from anysim_mcap.foxglove.video import KEYFRAMES, h264
from anysim_recording.collector import Collector
from tests.plugins.mcap.everything import Still
from tests.plugins.mcap.exported import Heard, assert_consistent, heard
from tests.plugins.sensors.declared import SENSORS, world

pytestmark = pytest.mark.xdist_group("foxglove")  # one recording for all tests

STEPS = 9


def recorded(out: Path, **record: Any) -> Path:
    """An episode without images of what a rover with two LiDARs and a depth camera reads."""
    spec = world(sensors={name: SENSORS[name] for name in ("ring", "petals", "eye")})
    spec["world"]["sensors"]["petals"] = {**SENSORS["petals"], "delay": 1}
    spec["task"]["horizon"] = STEPS
    with anysim.make(spec | {"record": {"keep": "all", "cameras": [], **record}}) as env:
        list(Collector(env, Still(env), out, 1, seed=3).run())
    return out


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("recorded") / "run")


@pytest.fixture(scope="module")
def reader(run: Path) -> TrajectoryReader:
    return open_trajectory(next((run / "episodes").iterdir()))


@pytest.fixture(scope="module")
def out(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exported") / "foxglove"
    export([run], "foxglove", folder, failed_too=True)
    return folder / "episodes" / "000000" / "episode.mcap"


@pytest.fixture(scope="module")
def found(out: Path) -> dict[str, list[Heard]]:
    return heard(out)


def test_it_holds_the_recording_as_it_is_and_more(found: dict[str, list[Heard]], reader: TrajectoryReader) -> None:
    before = heard(reader.directory / "trajectory.mcap")
    for topic, rows in before.items():
        assert [(*row[:3], row.data) for row in found[topic]] == [(*row[:3], row.data) for row in rows]
    schemas = {topic: rows[0].schema for topic, rows in found.items() if topic not in before}
    assert schemas == {
        "/scene": "foxglove.SceneUpdate",
        "/sensor/ring": "foxglove.LaserScan",
        "/sensor/petals": "foxglove.PointCloud",
        "/sensor/eye/depth": "foxglove.RawImage",
        "/instruction": "foxglove.Log",
    }
    assert_consistent(found)


def test_a_flat_scan_has_its_angles_and_what_was_lost_is_not_there(
    found: dict[str, list[Heard]], reader: TrajectoryReader
) -> None:
    valid = reader.states_from_reset("sensor_ring_valid")
    rows, ranges = found["/sensor/ring"], reader.states_from_reset("sensor_ring_range")
    assert [row.step for row in rows] == np.flatnonzero(valid).tolist()
    assert 1 < len(rows) < STEPS + 1
    for row in rows:
        scan = row.message
        assert (scan.frame_id, scan.pose.position.z) == ("rover", 0.15)
        assert (scan.start_angle, scan.end_angle) == pytest.approx((-np.pi, np.pi - 2 * np.pi / 90))
        met = np.isfinite(scan.ranges)
        assert np.array(scan.ranges)[met].tolist() == ranges[row.step][met].tolist()
        assert (ranges[row.step][~met] >= 8.0).all()
        assert list(scan.intensities) == reader.states_from_reset("sensor_ring_intensity")[row.step].tolist()
        assert scan.ranges[45] == pytest.approx(1.8, abs=0.1)  # ahead the crate


def test_points_of_a_late_scan_lie_on_what_was_there(found: dict[str, list[Heard]], reader: TrajectoryReader) -> None:
    rows, poses = found["/sensor/petals"], reader.states_from_reset("body_pose")
    assert [row.step for row in rows] == [0, 3, 5, 7, 9]  # read at every second step, and seen one later
    assert [row.message.timestamp.nanos // 20_000_000 for row in rows] == [0, 2, 4, 6, 8]
    bodies = reader.manifest.layout.bodies
    clouds = list[bytes]()
    for row in rows:
        cloud, step = row.message, row.message.timestamp.nanos // 20_000_000
        assert [field.name for field in cloud.fields] == ["x", "y", "z"]
        points = np.frombuffer(cloud.data, np.float32).reshape(-1, 3).astype(float)
        assert len(points) > 10
        p, q = cloud.pose.position, cloud.pose.orientation
        seat = P.compose(poses[step, bodies.index(cloud.frame_id)], np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w]))
        there = P.rotate(seat[3:], points) + seat[:3]
        crate = np.abs(
            P.rotate_inverse(poses[step, bodies.index("crate")][3:], there - poses[step, bodies.index("crate"), :3])
        )
        onto_crate = np.abs(np.maximum(crate - 0.2, 0.0)).sum(axis=1) + np.abs(crate.max(axis=1) - 0.2)
        assert (np.minimum(np.abs(there[:, 2]), onto_crate) < 1e-5).all()
        clouds.append(cloud.data)
    assert len(set(clouds)) == len(clouds)  # the pattern never repeats


def test_depth_of_a_sensor_is_an_image(found: dict[str, list[Heard]], reader: TrajectoryReader) -> None:
    depth = reader.states_from_reset("sensor_eye_depth")
    assert len(found["/sensor/eye/depth"]) == STEPS + 1
    for row in found["/sensor/eye/depth"]:
        assert (row.message.encoding, row.message.height, row.message.width) == ("32FC1", 16, 24)
        assert row.message.data == depth[row.step].tobytes()


def test_a_scan_out_of_its_plane_is_a_cloud_with_what_else_was_read() -> None:
    directions = np.array([[1.0, 0.0, 0.0], [0.6, 0.0, 0.8], [0.0, 1.0, 0.0]])
    reading = {
        "range": np.array([2.0, 9.0, 0.5], np.float32),
        "intensity": np.array([0.5, 0.0, 0.25], np.float32),
        "class_id": np.array([7, 0, 3], np.int32),
    }
    cloud = scan_message(Rays(-1, np.array([0, 0, 1, 0, 0, 0, 1.0]), directions, 9.0), "world", reading, 1_500_000_000)
    assert [(f.name, f.offset, f.type) for f in cloud.fields] == [
        ("x", 0, 7),
        ("y", 4, 7),
        ("z", 8, 7),
        ("intensity", 12, 7),
        ("class_id", 16, 6),
    ]
    table = np.frombuffer(cloud.data, [("point", "<f4", 3), ("intensity", "<f4"), ("class_id", "<i4")])
    assert cloud.point_stride == table.itemsize
    assert table["point"].tolist() == [[2.0, 0.0, 0.0], [0.0, 0.5, 0.0]]
    assert (table["intensity"].tolist(), table["class_id"].tolist()) == ([0.5, 0.25], [7, 3])
    uneven = directions[[0, 2]][[0, 1, 0]]
    assert type(scan_message(Rays(-1, cloud_pose(), uneven, 9.0), "world", reading, 0)).__name__ == "PointCloud"


def cloud_pose() -> np.ndarray:
    return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def test_the_scene_has_every_visible_shape_on_its_body() -> None:
    objects = {
        "crate": {"source": {"box": [0.2, 0.4, 0.6]}, "color": [1.0, 0.5, 0.0]},
        "ball": {"source": {"sphere": 0.25}},
        "can": {"source": {"cylinder": [0.1, 0.5]}, "fixed": True},
        "pill": {"source": {"capsule": [0.1, 0.4]}},
    }
    spec = world(sensors={})
    spec["world"] = {"objects": objects}
    spec["world"]["layout"] = {name: {"on": "terrain", "x": 2.0 * i, "y": 0.0} for i, name in enumerate(objects)}
    spec["world"]["terrain"] = {"kind": "heightfield", "heights": [[0, 0.1], [0, 0.1]], "size": [20, 2]}
    with anysim.make(spec) as env:
        env.reset(seed=0)
        update, geoms = scene_update(env.engine), [g for g in env.engine.world.geoms if g.visible]
    entities = {entity.frame_id: entity for entity in update.entities}
    crate, ball, pill = (entities[name] for name in ("crate", "ball", "pill"))
    assert (crate.cubes[0].size.x, crate.cubes[0].size.y, crate.cubes[0].size.z) == (0.2, 0.4, 0.6)
    assert (crate.cubes[0].color.r, crate.cubes[0].color.g, crate.cubes[0].color.a) == (1.0, 0.5, 1.0)
    assert ball.spheres[0].size.x == ball.spheres[0].size.z == 0.5
    assert [s.pose.position.z for s in pill.spheres] == [-pill.cylinders[0].size.z / 2, pill.cylinders[0].size.z / 2]
    assert pill.cylinders[0].size.x == pill.spheres[0].size.x == 0.2
    [can] = [entity for entity in update.entities if entity.cylinders and not entity.spheres]
    assert (can.cylinders[0].size.z, can.cylinders[0].bottom_scale) == (0.5, 1.0)
    ground = entities["world"].triangles[0]
    assert (len(ground.points), len(ground.indices)) == (4, 6)
    assert {round(p.z, 3) for p in ground.points} == {0.0, 0.1}
    drawn = sum(len(e.cubes) + len(e.cylinders) + len(e.spheres) + len(e.triangles) for e in update.entities)
    assert drawn == len(geoms) + 2  # a capsule is three
    assert all(entity.frame_locked for entity in update.entities)


def said(records: list[Any], annotator: str = "mine", step: int = 2) -> tuple[StreamInfo, list[StreamRow]]:
    keys = {key: {} for key in records[0]}
    info = StreamInfo(kind="data", frame="camera/front", about={"annotator": annotator, "records": keys})
    return info, [StreamRow("annotation/front/mine", step, records)]


def drawn(records: list[Any], annotator: str = "mine") -> list[tuple[int, Any]]:
    info, rows = said(records, annotator)
    assert has_marks(info)
    times = [0.02 * step for step in range(5)]
    return [(step, ImageAnnotations.FromString(data)) for step, data in marks(rows, info, times)]


def test_records_are_drawn_by_their_keys() -> None:
    [(step, message)] = drawn(
        [{"id": 1, "name": "cube", "box": [1, 2, 5, 8]}, {"id": 2, "name": "jar", "box": [0, 0, 1, 1]}]
    )
    assert (step, message.timestamp.nanos) == (2, 40_000_000)
    [cube, jar] = message.points
    assert cube.type == cube.LINE_LOOP
    assert [(p.x, p.y) for p in cube.points] == [(1, 2), (5, 2), (5, 8), (1, 8)]
    assert cube.outline_color != jar.outline_color
    assert [text.text for text in message.texts] == ["cube", "jar"]
    skeleton = {"robot": "arm", "parents": [-1, 0, 1, 1], "pixels": [[1, 1], [2, 2], [None, None], [4, 5]]}
    [(_, message)] = drawn([skeleton])
    [bones, links] = message.points
    assert (bones.type, links.type) == (bones.LINE_LIST, bones.POINTS)
    assert [(p.x, p.y) for p in bones.points] == [(2, 2), (1, 1), (4, 5), (2, 2)]
    assert len(links.points) == 3
    [(_, message)] = drawn([{"tool": "hand", "pixel": [3.5, 4.5], "trail": [[1, 1], [None, None], [2, 3]]}])
    assert [(p.x, p.y) for p in message.points[0].points] == [(1, 1), (2, 3), (3.5, 4.5)]
    assert (message.circles[0].position.x, message.texts[0].text) == (3.5, "hand")
    [(_, message)] = drawn([{"tool": "hand", "pixel": [None, None], "trail": []}])
    assert not message.points
    assert not message.circles


def test_a_box_in_space_is_twelve_edges_and_of_a_segment_where_it_began() -> None:
    corners = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    record = {"name": "jar", "corners": corners, "pixels": [[x + 3 * z, y + 5 * z] for x, y, z in corners]}
    [(step, message)] = drawn([{**record, "first_step": 1, "last_step": 2}], "obj_bbox")
    assert step == 1
    points = [(p.x, p.y) for p in message.points[0].points]
    assert len(points) == 24
    at = {tuple(pixel): corner for pixel, corner in zip(record["pixels"], corners, strict=True)}
    for a, b in zip(points[::2], points[1::2], strict=True):
        assert np.abs(np.subtract(at[a], at[b])).sum() == 1  # along one axis
    assert len({frozenset(pair) for pair in zip(points[::2], points[1::2], strict=True)}) == 12


def test_what_cannot_be_drawn_has_no_marks() -> None:
    assert not has_marks(StreamInfo(kind="data", about={"records": {"cell": {}}}))
    assert not has_marks(StreamInfo(kind="array", about={"records": {"box": {}}}))
    assert not has_marks(StreamInfo(kind="data"))


def test_a_video_is_one_picture_a_message_and_begins_anew_in_time() -> None:
    images = [np.full((17, 31, 3), 5 * k, np.uint8) for k in range(KEYFRAMES + 5)]
    units = list(h264(((2 * k, image) for k, image in enumerate(images)), 10))
    assert [step for step, _ in units] == [2 * k for k in range(len(images))]
    assert units == list(h264(((2 * k, image) for k, image in enumerate(images)), 10))
    keys = [k for k, (_, unit) in enumerate(units) if b"\0\0\0\1\x67" in unit]  # with its parameters
    assert keys == [0, KEYFRAMES]
    decoder: Any = av.CodecContext.create("h264", "r")
    decoder.thread_count, decoder.options = 1, {"flags": "low_delay"}
    shown = [frame.to_ndarray(format="rgb24") for _, unit in units for frame in decoder.decode(av.Packet(unit))]
    shown += [frame.to_ndarray(format="rgb24") for frame in decoder.decode(None)]
    assert len(shown) == len(images)
    for image, other in zip(images, shown, strict=True):
        assert other.shape == (18, 32, 3)
        assert np.abs(other[:17, :31].astype(int) - image).max() < 8


def test_equal_exports_are_equal_bytes(run: Path, out: Path, tmp_path: Path) -> None:
    export([run], "foxglove", tmp_path / "again", failed_too=True)
    assert (tmp_path / "again" / "episodes" / "000000" / "episode.mcap").read_bytes() == out.read_bytes()


def test_recordings_without_motion_are_refused(tmp_path: Path) -> None:
    run = recorded(tmp_path / "run", options={"transforms": False})
    with pytest.raises(RecordError, match="hold no /tf"):
        export([run], "foxglove", tmp_path / "out", failed_too=True)

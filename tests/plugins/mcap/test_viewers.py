"""A run with every stream and its export, opened by readers of others, message by message.

MCAP's own Python reader; Foxglove's reader from npm and Rerun's, each where it is there: `make test-viewers`.
"""

import base64
import importlib.util
import json
import math
import re
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim.math import pose as P
from anysim.record.film import camera_of
from anysim.record.reader import TrajectoryReader, open_trajectory
from anysim.record.replay import begin, rebuild
from anysim_export.job import export
from anysim_film.filmer import Filmer
from anysim_film.stage import FilmOrder
from anysim_inspect.verify import verify
from anysim_mcap import messages as m
from tests.plugins.export.runs import record
from tests.plugins.mcap.exported import assert_consistent, frames, heard

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[3]
NODE = ROOT / ".node-mcap"
needs_node = pytest.mark.skipif(not (NODE / "installed").exists(), reason="needs @mcap/core: make test-viewers")
needs_rerun = pytest.mark.skipif(importlib.util.find_spec("rerun") is None, reason="needs rerun-sdk: make test-viewers")
LABELS = "{boxes_2d: {}, boxes_3d: {}, skeleton: {}, eef_waypoint: {}, obj_bbox: {}, affordance: {}, point_cloud: {}}"
EVERYTHING = (
    "record.cameras=[front]",  # wrist has streams alone, and side nothing
    "world.cameras.side={from: [1.0, 1.0, 1.0], look_at: [0, 0, 0.5], size: [16, 12]}",
    "world.cameras.wrist.channels=[rgb, depth]",
    "world.cameras.front.channels=[rgb, depth, segmentation]",
    "record.channels={front: [depth, segmentation], wrist: [depth]}",
    f"record.streams={{annotations: {{annotators: {LABELS}, cameras: [front, wrist]}}, language: {{}}}}",
    "world.sensors={scan: {sensor: lidar, frame: panda.tool, pattern: {kind: planar, columns: 12}, far: 2.0}, "
    "dome: {sensor: lidar, frame: table, pattern: {kind: solid_state, count: 30, half_angle: 0.4}, rate: 10, "
    "position: [0, 0, 0.4], roll_pitch_yaw: [0, 0.5, 0], delay: 1}, "
    "eye: {sensor: depth, frame: table, size: [8, 6], position: [0, 0, 0.4]}}",
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("recorded") / "run", 1, *EVERYTHING)


@pytest.fixture(scope="module")
def reader(run: Path) -> TrajectoryReader:
    return open_trajectory(next((run / "episodes").iterdir()))


@pytest.fixture(scope="module")
def out(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exported") / "foxglove"
    export([run], "foxglove", folder)
    return folder / "episodes" / "000000" / "episode.mcap"


@pytest.fixture(scope="module")
def files(reader: TrajectoryReader, out: Path) -> list[Path]:
    return [*sorted(reader.directory.glob("*.mcap")), out]


def test_every_channel_decodes_with_its_times_frames_and_counts(reader: TrajectoryReader, files: list[Path]) -> None:
    *recorded, exported = [heard(path) for path in files]
    assert len(recorded) == 4
    whole = {topic: rows for one in recorded for topic, rows in one.items()}
    for topic, rows in whole.items():
        assert [row.data for row in exported[topic]][-len(rows) :] == [
            row.data for row in rows
        ] or topic == "/tf_static"
        times = [round(reader.times_from_reset[row.step] * 1e9) for row in rows]
        assert [row.time for row in rows] == times, topic
    for name, entry in reader.manifest.streams.items():
        assert len(whole.get(f"/{name}", ())) == entry.rows, name
    assert_consistent(exported)
    assert {row.schema for rows in exported.values() for row in rows if row.schema.startswith("foxglove.")} == {
        f"foxglove.{name}"
        for name in (
            "CameraCalibration",
            "CompressedVideo",
            "FrameTransforms",
            "ImageAnnotations",
            "JointStates",
            "LaserScan",
            "Log",
            "PointCloud",
            "RawImage",
            "SceneUpdate",
        )
    }


def test_what_is_worked_out_is_that_of_the_states(reader: TrajectoryReader, out: Path) -> None:
    found, steps = heard(out), list(range(reader.manifest.steps + 1))
    joints = found["/joint_states"]
    assert [row.step for row in joints] == steps
    for name, kind in (("joint_pos", "position"), ("joint_vel", "velocity")):
        rows = reader.states_from_reset(name)
        assert [[getattr(j, kind) for j in row.message.joints] for row in joints] == rows.tolist()
    assert [j.name for j in joints[0].message.joints] == list(reader.manifest.layout.joints)
    cameras = {topic for topic in found if topic.endswith("/calibration")}
    assert cameras == {f"/camera/{name}/calibration" for name in ("front", "wrist", "side")}
    assert {f"camera/{name}" for name in ("front", "wrist", "side")} <= frames(found)
    assert all(len(found[topic]) == 1 for topic in cameras)
    assert len(found["/camera/front"]) == reader.manifest.cameras["front"].frames
    assert [row.step for row in found["/sensor/scan"]] == steps
    assert len({row.message.timestamp.nanos for row in found["/sensor/dome"]}) > 3
    boxes = found["/annotation/front/boxes_2d"]
    for row, marks in zip(boxes, found["/annotation/front/boxes_2d/marks"], strict=True):
        assert row.time == marks.time
        assert [text.text for text in marks.message.texts] == [record["name"] for record in row.message["data"]]
    segments = found["/annotation/front/obj_bbox"]
    begun = [record["first_step"] for row in segments for record in row.message["data"]]
    assert [row.step for row in found["/annotation/front/obj_bbox/marks"]] == begun
    assert found["/sub_task"][0].message.message.startswith("pick")
    assert all(a.message.message != b.message.message for a, b in pairwise(found["/sub_task"]))


@pytest.mark.parametrize("camera", ["front", "wrist"])
def test_shapes_seen_through_the_lenses_are_where_the_drawings_are(out: Path, camera: str) -> None:
    """Scene, transforms, calibration and marks, which come from four places: a viewer lays one over the other."""
    found = heard(out)
    [lens] = [row.message for row in found[f"/camera/{camera}/calibration"]]
    places = [row for rows in found.values() for row in rows if row.schema == "foxglove.FrameTransforms"]
    fixed = {t.child_frame_id: t for row in places if row.step == 0 for t in row.message.transforms}[f"camera/{camera}"]
    [cube] = [entity for entity in found["/scene"][0].message.entities if entity.frame_id == "cube"]
    [box] = cube.cubes
    half = np.array([box.size.x, box.size.y, box.size.z]) / 2
    corners = half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    compared = 0
    for row in found[f"/annotation/{camera}/boxes_3d/marks"]:
        shown = [text.text for text in row.message.texts]
        if "cube" not in shown:
            continue
        moved = {t.child_frame_id: t for t in found["/tf"][row.step].message.transforms}
        eye = placed(fixed)
        if fixed.parent_frame_id != "world":
            eye = P.compose(placed(moved[fixed.parent_frame_id]), eye)
        thing = placed(moved["cube"])
        world = thing[:3] + P.rotate(thing[3:], corners)
        x, y, z = P.rotate_inverse(eye[3:], world - eye[:3]).T
        pixels = np.stack([lens.K[0] * x / z + lens.K[2], lens.K[4] * y / z + lens.K[5]], axis=-1)
        edges = row.message.points[shown.index("cube")].points
        drawn = np.array([[p.x, p.y] for p in edges])
        if len(edges) == 24 and (z > 0).all():
            np.testing.assert_allclose(sorted(map(tuple, pixels)), sorted({tuple(one) for one in drawn}), atol=1e-6)
            compared += 1
    assert compared > 5


def placed(transform: Any) -> np.ndarray:
    p, q = transform.translation, transform.rotation
    return np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])


def test_a_camera_without_a_video_has_its_lens_and_place_beside_its_streams(reader: TrajectoryReader) -> None:
    with rebuild(reader.manifest) as env:
        begin(env, reader.manifest)
        wrist = camera_of(env, 0, "wrist")
    lens, place = (reader.stream(f"camera/wrist/{name}") for name in ("calibration", "place"))
    assert place.values == [{"parent": wrist.parent, "pose": list(wrist.pose)}]
    assert lens.values == [{"width": wrist.width, "height": wrist.height, "k": m.intrinsics(wrist)}]
    assert lens.steps.tolist() == place.steps.tolist() == [0]
    assert "camera/front/place" not in reader.names()
    assert verify(reader.directory) == []


def test_a_camera_that_was_filmed_later_has_its_video_lens_and_place(reader: TrajectoryReader, tmp_path: Path) -> None:
    copy = shutil.copytree(reader.directory, tmp_path / "run" / "episodes" / reader.directory.name)
    with Filmer(FilmOrder(("wrist", "side"))) as filmer:
        filmer.film(copy)
    assert verify(copy) == []
    export([copy], "foxglove", tmp_path / "out")
    found = heard(tmp_path / "out" / "episodes" / "000000" / "episode.mcap")
    assert_consistent(found)
    for name in ("front", "wrist", "side"):
        assert len(found[f"/camera/{name}"]) == len(found["/camera/front"])
        assert len(found[f"/camera/{name}/calibration"]) == 1
        assert f"camera/{name}" in frames(found)


def test_the_page_lists_what_is_worked_out_and_nothing_else(reader: TrajectoryReader, files: list[Path]) -> None:
    *recorded, exported = [heard(path) for path in files]
    before = {(topic, row.data) for one in recorded for topic, rows in one.items() for row in rows}
    new = {(topic, row.schema) for topic, rows in exported.items() for row in rows if (topic, row.data) not in before}
    page = (ROOT / "docs" / "export.md").read_text().split("## Foxglove", 1)[1].split("\n## ", 1)[0]
    said = [
        (topic, schema)
        for topics, schemas in re.findall(r"^\| (`/.*?`) \| (foxglove\..*?) \|", page, re.MULTILINE)
        for topic in re.findall(r"`(.*?)`", topics)
        for schema in schemas.split(", ")
    ]
    matches = {pair: [one for one in new if one[1] == pair[1] and _named(pair[0], one[0])] for pair in said}
    assert all(matches.values()), matches
    assert {one for found in matches.values() for one in found} == new


def test_the_page_of_records_names_every_stream_with_its_schema(reader: TrajectoryReader, files: list[Path]) -> None:
    recorded = {topic[1:]: rows[0].schema for path in files[:-1] for topic, rows in heard(path).items()}
    page = (ROOT / "docs" / "concepts" / "record.md").read_text().split("## Streams", 1)[1].split("\n## ", 1)[0]
    rows = re.findall(r"^\| (`.*?`) \| .*? \| (.*?) \|$", page, re.MULTILINE)
    used = set[int]()
    for name in reader.names():
        found = [
            k
            for k, (names, schemas) in enumerate(rows)
            if any(_named(pattern, name) for pattern in re.findall(r"`(.*?)`", names))
            and (name not in reader.manifest.streams or recorded[name].replace("anysim.Data", "JSON") in schemas)
        ]
        assert len(found) == 1, name
        used |= {found[0]}
    assert used == set(range(len(rows)))


def _named(pattern: str, topic: str) -> bool:
    """Whether a topic is one of a pattern: words in capitals stand for a name, `…` for more of them."""
    return re.fullmatch(re.sub(r"[A-Z]+", "[^/]+", pattern).replace("…", "(/.*)?"), topic) is not None


# ---------------------------------------------------------------------- Foxglove's reader


def same(message: Any, other: Any) -> bool:
    """Whether a message of protobuf's Python library is what the one of JavaScript decoded."""
    for field in message.DESCRIPTOR.fields:
        value, theirs = getattr(message, field.name), other.get(field.name)
        if hasattr(value, "append"):
            if len(value) != len(theirs) or not all(map(_equal, value, theirs, [field] * len(value))):
                return False
        elif theirs is None:  # an optional number or a message that is not there
            if message.HasField(field.name):
                return False
        elif not _equal(value, theirs, field):
            return False
    return True


def _equal(value: Any, other: Any, field: Any) -> bool:
    if field.message_type is not None:
        return same(value, other)
    if isinstance(value, bytes):
        return base64.b64decode(other) == value
    if field.enum_type is not None:
        return other in (value, field.enum_type.values_by_number[value].name)
    if isinstance(value, float) and not math.isfinite(value):
        return float(str(other).replace("Infinity", "inf")) == value
    return value == other


@needs_node
def test_foxgloves_own_reader_decodes_the_same(files: list[Path]) -> None:
    words = ["node", str(Path(__file__).with_name("read_mcap.cjs")), str(NODE), *map(str, files)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    for path, theirs in zip(files, json.loads(done.stdout), strict=True):
        ours = heard(path)
        assert ours.keys() == theirs.keys()
        for topic, rows in ours.items():
            assert [list(row[:3]) for row in rows] == [row[:3] for row in theirs[topic]], topic
            for row, (*_, content) in zip(rows, theirs[topic], strict=True):
                assert content == row.message if isinstance(row.message, dict) else same(row.message, content), topic


# ---------------------------------------------------------------------- Rerun's reader


def tool(*words: str) -> str:
    """Run Rerun's own tool."""
    command = [str(Path(sys.executable).with_name("rerun")), *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def columns(path: Path) -> dict[str, dict[str, list[Any]]]:
    """What Rerun makes of each topic of an MCAP file: its components, row by row."""
    from rerun.chunk import RrdReader  # pyright: ignore[reportMissingImports]

    tool("mcap", "convert", str(path), "-o", str(path.with_suffix(".rrd")))
    found: dict[str, dict[str, list[Any]]] = {}
    for chunk in RrdReader(path.with_suffix(".rrd")).stream().to_chunks():
        for name, values in chunk.to_record_batch().to_pydict().items():
            if not chunk.is_static:
                found.setdefault(chunk.entity_path, {}).setdefault(name, []).extend(values)
    return found


@needs_rerun
def test_rerun_decodes_every_channel(files: list[Path], tmp_path: Path) -> None:
    drawn = {
        "foxglove.FrameTransforms": "Transform3D:translation",
        "foxglove.CameraCalibration": "Pinhole:resolution",
        "foxglove.CompressedVideo": "VideoStream:sample",
        "foxglove.RawImage": "Image:buffer",
        "foxglove.Log": "TextLog:text",
        "foxglove.PointCloud": "Points3D:positions",
    }
    for path in files:
        tool("mcap", "check", "--full", str(path))
        copy = tmp_path / path.name
        copy.write_bytes(path.read_bytes())
        found, ours = columns(copy), heard(path)
        for topic, rows in ours.items():
            theirs = found[topic]
            if topic in ("/tf", "/tf_static"):
                assert len(theirs["Transform3D:translation"]) == sum(len(row.message.transforms) for row in rows)
                continue
            assert len(theirs["message_log_time"]) == len(rows), topic
            times = [int(time.timestamp() * 1e6 + 0.5) * 1000 for time in theirs["message_log_time"]]
            assert times == [row.time for row in rows], topic
            name = drawn.get(rows[0].schema)
            if name is not None:
                assert len(theirs[name]) == len(rows), topic
            elif rows[0].schema != "anysim.Data" and not isinstance(rows[0].message, dict):
                assert any(key.startswith(rows[0].schema) for key in theirs), (topic, list(theirs))

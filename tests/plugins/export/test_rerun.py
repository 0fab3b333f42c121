"""Recordings of Rerun, read by its own reader: poses, shapes, images, numbers and words of the recorded episodes.

`make test-rerun` runs these, in an environment with rerun-sdk.
"""

import importlib.util
import io
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from anysim.record.reader import open_trajectory
from anysim.record.replay import begin
from anysim_export.api import DataSet, Episode
from anysim_export.envs import env_of
from anysim_export.job import export
from anysim_export.parts import made
from anysim_export.rerun.shapes import corner_normals, field_mesh
from anysim_export.streams import channels_of, streams_of
from tests.plugins.export.runs import committed, record

EXPORTED = "episodes/{:06d}/episode.rrd"
needs_rerun = pytest.mark.skipif(importlib.util.find_spec("rerun") is None, reason="needs rerun-sdk: make test-rerun")


@pytest.fixture(scope="module")
def episodes(tmp_path_factory: pytest.TempPathFactory) -> list[Episode]:
    """Two recorded episodes."""
    run = record(tmp_path_factory.mktemp("recorded") / "run", 2)
    return [Episode(i, open_trajectory(path)) for i, path in enumerate(committed(run))]


@pytest.fixture(scope="module")
def out(episodes: list[Episode], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recordings."""
    folder = tmp_path_factory.mktemp("exported") / "rerun"
    export([one.directory for one in episodes], "rerun", folder)
    return folder


def columns(path: Path) -> dict[str, dict[str, Any]]:
    """All rows of each entity, by column: what is there for the whole recording, and what changes."""
    from rerun.chunk import RrdReader  # pyright: ignore[reportMissingImports]

    found: dict[str, dict[str, Any]] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        kind = "shape:" if chunk.is_static else ""
        rows = found.setdefault(chunk.entity_path, {})
        for name, values in chunk.to_record_batch().to_pydict().items():
            rows.setdefault(kind + name, []).extend(values)
    return found


@needs_rerun
def test_what_it_says_it_takes_is_there(episodes: list[Episode], out: Path) -> None:
    """Each entity that the exporter declares, and no other with numbers or words."""
    exporter, options = made("rerun", {})
    places = exporter.places(DataSet([episodes[0].manifest], options))
    assert set(places) <= set(streams_of(episodes[0].manifest))
    declared = {place.strip("`").split("/NAME")[0].split("/BODY")[0] for place in places.values()}
    declared = {one.partition("`")[0] for one in declared}
    entities = set(columns(out / EXPORTED.format(0)))
    for place in declared:
        assert any(f"{entity}/".startswith(f"/{place}/") for entity in entities), place
    roots = {place.partition("/")[0] for place in declared}
    assert {entity.split("/")[1] for entity in entities if entity != "/"} - {"__properties"} == roots


@needs_rerun
def test_its_reader_finds_the_episode(episodes: list[Episode], out: Path) -> None:
    for one in episodes:
        found, steps = columns(out / EXPORTED.format(one.index)), list(range(one.steps + 1))
        assert "/__warnings" not in found
        for i, body in enumerate(one.manifest.layout.bodies):
            moved = found[f"/world/{body}"]
            assert moved["step"] == steps
            poses = one.states["body_pose"][:, i].astype(np.float32)
            np.testing.assert_array_equal(np.array(moved["Transform3D:translation"], np.float32)[:, 0], poses[:, :3])
            np.testing.assert_array_equal(np.array(moved["Transform3D:quaternion"], np.float32)[:, 0], poses[:, 3:])
            assert moved["time"][10].total_seconds() == pytest.approx(0.2)
        assert np.ravel(found["/reward"]["Scalars:scalars"]).tolist() == one.rewards.tolist()
        assert np.ravel(found["/success"]["Scalars:scalars"]).tolist() == [0.0] * (one.steps - 1) + [1.0]
        for name, values in zip(one.manifest.layout.action, one.actions.T, strict=True):
            assert np.ravel(found[f"/action/{name}"]["Scalars:scalars"]).tolist() == values.tolist()
            assert found[f"/action/{name}"]["step"] == steps[:-1]
        assert found["/instruction"]["TextLog:text"] == [["Lift the cube to the goal and come to rest."]]
        said = dict(zip(found["/sub_task"]["step"], np.ravel(found["/sub_task"]["TextLog:text"]), strict=True))
        changes = {t: s for t, s in enumerate(one.segments) if t == 0 or s != one.segments[t - 1]}
        assert said == changes
        assert len(said) > 2


@needs_rerun
def test_shapes_have_the_colours_of_the_episode_and_cameras_their_images(episodes: list[Episode], out: Path) -> None:
    one = episodes[0]
    found = columns(out / EXPORTED.format(0))
    cube = found["/world/cube/cube.shape"]
    with env_of(one.manifest.spec) as env:
        world = env.engine.world
        [number] = [i for i, geom in enumerate(world.geoms) if geom.name == "cube.shape"]
        shape, nominal = world.geoms[number].shape, np.array(world.geoms[number].color)
        begin(env, one.manifest)
        color = env.engine.get_parameters("geom.color")[0, number]
        seen = [geom for geom in world.geoms if geom.visible]
    assert np.array(cube["shape:Boxes3D:half_sizes"][0][0]) == pytest.approx(shape.half_size)
    packed = int(cube["shape:Boxes3D:colors"][0][0])
    assert not np.array_equal(color, nominal)  # it was drawn
    assert [packed >> shift & 255 for shift in (24, 16, 8, 0)] == np.round(color * 255).tolist()
    assert sum(any(name.startswith("shape:Transform3D") for name in rows) for rows in found.values()) == len(seen)
    link = found["/world/panda.panda_link1/panda.panda_link1.visual0"]
    mesh = next(m for m in world.meshes if len(m.vertices) == len(link["shape:Mesh3D:vertex_positions"][0]))
    np.testing.assert_array_equal(link["shape:Mesh3D:triangle_indices"][0], mesh.faces)
    lens = found["/world/cameras/front"]
    assert lens["shape:Pinhole:resolution"] == [[[48.0, 32.0]]]
    images = list(one.images("front"))
    shown = found["/world/cameras/front/image"]
    assert shown["step"] == list(range(0, one.steps + 1, 2))  # each when it was taken
    for step, [blob] in list(zip(shown["step"], shown["EncodedImage:blob"], strict=True))[::9]:
        image = np.asarray(Image.open(io.BytesIO(bytes(blob)))).astype(int)
        assert np.abs(image - images[step]).mean() < 5.0
    wrist = np.array(found["/world/cameras/wrist"]["Transform3D:translation"])[:, 0]
    assert np.ptp(wrist, axis=0).max() > 0.05  # it is on the hand
    assert np.ptp(np.array(lens["Transform3D:translation"])[:, 0], axis=0).max() == 0.0


@needs_rerun
def test_depth_is_in_metres_with_every_bit_and_segmentation_has_its_legend(episodes: list[Episode], out: Path) -> None:
    one, found = episodes[0], columns(out / EXPORTED.format(0))
    legend: dict[int, str] = {}
    for channel in channels_of(one.manifest):
        shown, recorded = found[f"/world/cameras/front/{channel.name}"], list(one.channel(channel))
        kind = "DepthImage" if channel.name == "depth" else "SegmentationImage"
        assert shown["step"] == list(range(0, one.steps + 1, 2))  # each when it was taken
        form = shown[f"shape:{kind}:format"][0][0]
        assert (form["width"], form["height"]) == (48, 32)
        for step, [buffer] in zip(shown["step"], shown[f"{kind}:buffer"], strict=True):
            there = np.frombuffer(bytes(buffer), channel.entry.dtype).reshape(32, 48)
            np.testing.assert_array_equal(there, recorded[step])
        if channel.name == "depth":
            assert shown["shape:DepthImage:meter"] == [[1.0]]
        else:
            [[said]] = shown["shape:AnnotationContext:context"]
            legend = {row["class_id"]: row["class_description"]["info"]["label"] for row in said}
    assert "cube" in legend.values()
    assert legend == {row["id"]: row["name"] for row in channels_of(one.manifest)[1].about["legend"]}
    said, narrated = list(one.held("language/narration")), found["/language/narration"]
    starts = [t for t in range(one.steps + 1) if said[t] is not None and (t == 0 or said[t] != said[t - 1])]
    assert narrated["step"] == starts
    assert [row[0] for row in narrated["TextLog:text"]] == [said[t] for t in starts]


@needs_rerun
def test_its_tools_verify_the_files_and_find_equal_exports_equal(
    episodes: list[Episode], out: Path, tmp_path: Path
) -> None:
    tool = [str(Path(sys.executable).with_name("rerun")), "rrd"]
    files = [str(out / EXPORTED.format(one.index)) for one in episodes]
    verified = subprocess.run([*tool, "verify", *files], capture_output=True, text=True, timeout=120, check=False)
    assert verified.returncode == 0, verified.stderr
    export([one.directory for one in episodes], "rerun", tmp_path / "again")
    for one in episodes:
        pair = [str(folder / EXPORTED.format(one.index)) for folder in (out, tmp_path / "again")]
        compared = subprocess.run(
            [*tool, "compare", "--unordered", *pair], capture_output=True, text=True, timeout=120, check=False
        )
        assert compared.returncode == 0, compared.stderr[-400:]
    others = [str(out / EXPORTED.format(i)) for i in range(2)]
    assert (
        subprocess.run(
            [*tool, "compare", "--unordered", *others], capture_output=True, timeout=120, check=False
        ).returncode
        != 0
    )


KILLED = """
import os, resource, signal, sys
from pathlib import Path
from anysim.errors import RecordError
from anysim_export.job import export
from anysim_export.rerun.exporter import RerunExporter
out, *runs = map(Path, sys.argv[1:])
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, resource.RLIM_INFINITY))
try:
    export(runs, "rerun", out)
except RecordError as error:
    print(error)
assert not out.exists()
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
whole = RerunExporter.write_episode
def killed(self, folder, episode, data):
    whole(self, folder, episode, data)
    if episode.index == 1:
        path = folder / "episode.rrd"
        path.write_bytes(path.read_bytes()[:5000])
        sys.stdout.flush()
        os.kill(os.getpid(), signal.SIGKILL)
RerunExporter.write_episode = killed
export(runs, "rerun", out)
"""


@needs_rerun
def test_killed_or_out_of_room_it_goes_on_to_the_same_content(
    episodes: list[Episode], out: Path, tmp_path: Path
) -> None:
    """In one program: files that may not grow, and then a death in the second episode, whose file is cut short."""
    again, runs = tmp_path / "again", [one.directory for one in episodes]
    words = [sys.executable, "-c", KILLED, str(again), *map(str, runs)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr[-400:]
    assert "File too large" in done.stdout
    assert not again.exists()
    assert export(runs, "rerun", again).resumed == 1
    tool = [str(Path(sys.executable).with_name("rerun")), "rrd", "compare", "--unordered"]
    for one in episodes:
        pair = [str(folder / EXPORTED.format(one.index)) for folder in (out, again)]
        assert subprocess.run([*tool, *pair], capture_output=True, timeout=120, check=False).returncode == 0


def test_a_height_field_is_two_triangles_a_cell_seen_from_above() -> None:
    from anysim.model.world import HeightField

    field = HeightField("hill", np.array([[0.0, 0.0, 0.0], [0.0, 0.5, 1.0]]), (4.0, 1.0))
    vertices, faces = field_mesh(field)
    assert vertices[[0, 2, 5]].tolist() == [[-2.0, -0.5, 0.0], [2.0, -0.5, 0.0], [2.0, 0.5, 1.0]]
    assert len(faces) == 4
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    assert (across[:, 2] > 0).all()
    assert across[:, 2].sum() / 2 == pytest.approx(4.0)  # they cover it once
    assert corner_normals(vertices, faces)[0] == pytest.approx([-0.2425, 0.0, 0.9701], abs=0.3)
    assert np.linalg.norm(corner_normals(vertices, faces), axis=1) == pytest.approx(np.ones(6))

"""A collected run with every stream: the same as what is made afterwards, the same in each run, and replayed."""

from pathlib import Path

import numpy as np
import pytest

from anysim.record.reader import TrajectoryReader, open_trajectory
from anysim.record.replay import rebuild, replay
from anysim_annotation.files import read_array, read_records
from anysim_annotation.orders import read_orders
from anysim_annotation.render import AnnotationMaker
from anysim_annotation.sheet import read_annotations
from anysim_film.stage import FilmOrder
from anysim_inspect.verify import verify_run
from anysim_language.describe import described_trajectory
from tests.plugins.mcap.everything import collected

pytestmark = pytest.mark.slow  # each kind of stream is looked at by itself in the fast tier
LABELS = "{boxes_2d: {}, flow: {}, point_cloud: {stride: 4}}"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes; not to be written to."""
    out = tmp_path_factory.mktemp("run")
    collected(out)
    return out


def readers(run: Path) -> list[TrajectoryReader]:
    return [open_trajectory(path) for path in sorted((run / "episodes").iterdir())]


def test_it_is_whole_and_replays_to_the_bit(run: Path) -> None:
    assert verify_run(run) == {"env_0000_episode_0000": [], "env_0001_episode_0000": []}
    for reader in readers(run):
        assert replay(reader.directory).identical
        assert reader.states["sensor_scan_instance_id"].dtype == np.int32
        assert reader.states["sensor_scan_range"].dtype == np.float32


def test_depth_and_segmentation_are_those_of_the_states(run: Path) -> None:
    (reader, _) = readers(run)
    depth, ids = reader.stream("camera/front/depth"), reader.stream("camera/front/segmentation")
    assert depth.steps.tolist() == ids.steps.tolist() == [0, 2, 4, 6, 8, 10, 12]
    legend = {one["id"]: one["name"] for one in reader.manifest.streams["camera/front/segmentation"].about["legend"]}
    assert {legend[number] for number in np.unique(ids.values).tolist() if number} == {"ball", "brick"}
    from anysim.record.replay import begin

    with rebuild(reader.manifest) as env:
        begin(env, reader.manifest)
        poses = reader.states_from_reset("body_pose")
        for row, step in enumerate(depth.steps.tolist()):
            seen = env.engine.render("front", channels=["depth", "segmentation"], body_pose=poses[step][None])
            far = env.engine.world.cameras[0].far
            assert np.array_equal(depth.values[row], np.minimum(seen["depth"][0], np.float32(far)))
            assert np.array_equal(ids.values[row], seen["segmentation"][0])


def test_annotations_are_those_made_afterwards(run: Path, tmp_path: Path) -> None:
    for reader in readers(run):
        with AnnotationMaker(FilmOrder(("front", "top")), read_orders(LABELS), "geometry") as maker:
            made = maker.annotate(reader.directory, tmp_path / reader.directory.name)
        sheet = read_annotations(made.directory)
        assert sheet is not None
        for camera in ("front", "top"):
            files = sheet.cameras[camera].annotators
            for name, key in (("flow", "flow"), ("flow", "occluded"), ("point_cloud", "world")):
                stream = reader.stream(f"annotation/{camera}/{name}" + ("" if key == name else f"/{key}"))
                for step, value in zip(stream.steps.tolist(), stream.values, strict=True):
                    other = read_array(made.directory, files[name].files[key], step)
                    assert value.dtype == other.dtype
                    assert np.array_equal(value, other, equal_nan=value.dtype.kind == "f")
            boxes = reader.stream(f"annotation/{camera}/boxes_2d")
            rows = [
                {"step": step, **record}
                for step, records in zip(boxes.steps.tolist(), boxes.values, strict=True)
                for record in records
            ]
            assert rows == read_records(made.directory / files["boxes_2d"].files["records"])
            assert len(rows) > 7


def test_language_is_the_description_of_what_was_committed(run: Path) -> None:
    for reader in readers(run):
        said = described_trajectory(reader.directory)
        assert reader.stream("language/scene").values == [said.scene]
        assert reader.stream("language/instruction").values == [said.instruction]
        told, facts = reader.stream("language/narration"), reader.stream("language/facts")
        assert list(zip(told.steps.tolist(), told.values, strict=True)) == [
            (one.step, one.text) for one in said.narration
        ]
        assert facts.values == [
            {"kind": one.kind, "what": one.what, "where": one.where, "who": one.who} for one in said.narration
        ]


def test_streams_change_nothing_else_and_equal_runs_give_equal_files(run: Path, tmp_path: Path) -> None:
    collected(tmp_path / "again")
    collected(tmp_path / "bare", "record.streams=null", "record.channels=null")
    for reader, again, bare in zip(readers(run), readers(tmp_path / "again"), readers(tmp_path / "bare"), strict=True):
        for name in reader.manifest.files:
            assert (reader.directory / name).read_bytes() == (again.directory / name).read_bytes(), name
        assert set(bare.manifest.files) == {"trajectory.mcap", "front.mp4", "top.mp4"}
        for name in bare.states:
            assert bare.states_from_reset(name).tobytes() == reader.states_from_reset(name).tobytes()
        for name in ("front.mp4", "top.mp4"):
            assert (reader.directory / name).read_bytes() == (bare.directory / name).read_bytes()


def test_nothing_is_written_of_what_is_not_kept(tmp_path: Path) -> None:
    results = collected(tmp_path, "record.keep=success")
    assert [result.status for result in results] == ["truncated", "truncated"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.json"]

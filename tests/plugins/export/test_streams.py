"""Streams of a recording in data sets: what each exporter says of them is so, and depth keeps every bit."""

import io
import json
import tarfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from export_table import recording
from PIL import Image

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.reader import open_trajectory
from anysim_export.api import DataSet, Episode, Exporter
from anysim_export.cli import _families  # pyright: ignore[reportPrivateUsage]
from anysim_export.job import export, omitted
from anysim_export.parts import made
from anysim_export.streams import streams_of
from tests.plugins.export.made import Made
from tests.plugins.export.runs import committed

FORMS = ("lerobot", "rlds-ready", "robomimic", "webdataset")
EVERYTHING = {
    "lerobot": {"channels": True, "privileged": True},
    "rlds-ready": {"states": True, "privileged": True},
    "webdataset": {"states": True},
}


def written(exporter: Exporter, data: DataSet, folder: Path, changed: str = "") -> dict[str, bytes]:
    """The files of an episode, of a recording in which a stream is another one."""
    folder.mkdir()
    exporter.write_episode(folder, Episode(0, Made(changed)), data)
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize("everything", [False, True])
@pytest.mark.parametrize("form", FORMS)
def test_an_export_follows_from_the_streams_that_it_says_it_takes(tmp_path: Path, form: str, everything: bool) -> None:
    """With each stream changed in turn: other bytes exactly where the exporter names the stream."""
    exporter, options = made(form, EVERYTHING.get(form, {}) if everything else {})
    one = recording()
    data = DataSet([one], options)
    before = written(exporter, data, tmp_path / "before")
    places = exporter.places(data)
    assert set(places) <= set(streams_of(one))
    assert len(places) > 6
    moved = {
        stream
        for number, stream in enumerate(streams_of(one))
        if written(exporter, data, tmp_path / str(number), stream) != before
    }
    assert moved == set(places)


def test_the_streams_are_those_of_the_reader(run: Path) -> None:
    for reader in (Made(), open_trajectory(committed(run)[0])):
        assert sorted(streams_of(reader.manifest)) == sorted(reader.names())


def test_what_is_left_out_comes_with_the_option_that_brings_it() -> None:
    exporter, options = made("lerobot", {})
    lacking = omitted("lerobot", exporter, DataSet([recording()], options))
    assert lacking["camera/front/depth"] == lacking["camera/front/segmentation"] == "channels=true"
    assert lacking["observation/privileged"] == "privileged=true"
    assert lacking["language/narration"] == lacking["state/joint_pos"] == ""
    assert "action" not in lacking
    assert _families({"state/a": "", "state/b": "", "camera/x": "images=true", "action": ""}) == (
        "state/a b, camera/x (--option images=true), action"
    )


@pytest.fixture(scope="module")
def recorded(run: Path) -> dict[str, list[Array]]:
    """Depth and segmentation as the recording's reader gives them, T+1 of each episode, each until the next one."""
    found: dict[str, list[Array]] = {}
    for path in committed(run):
        reader = open_trajectory(path)
        for name in ("depth", "segmentation"):
            rows = reader.stream(f"camera/front/{name}")
            assert rows.steps[0] == 0
            latest = np.searchsorted(rows.steps, np.arange(reader.manifest.steps + 1), side="right") - 1
            found.setdefault(name, []).append(rows.values[latest])
    assert np.ptp(found["depth"][0]) > 0.5
    assert len(np.unique(found["segmentation"][0])) > 3
    return found


def same(there: Any, expected: Array) -> None:
    """Equal bits, of one type."""
    assert there.dtype == expected.dtype
    np.testing.assert_array_equal(there.reshape(expected.shape).view(np.uint8), expected.view(np.uint8))


def test_depth_of_robomimic(run: Path, recorded: dict[str, list[Array]], tmp_path: Path) -> None:
    for scale in (1.0, 4.0, 3.0):
        out = tmp_path / f"scale_{scale:g}"
        export([run], "robomimic", out, {"depth_scale": scale, "images": False})
        with h5py.File(out / "demo.hdf5") as file:
            said = json.loads(file["channels"][()])  # pyright: ignore[reportIndexIssue, reportArgumentType]
            assert (said["front_depth"]["unit"], said["front_depth"]["scale"]) == ("m", scale)
            assert said["front_depth"]["far"] > said["front_depth"]["near"] > 0.0
            for i, (depth, entities) in enumerate(zip(recorded["depth"], recorded["segmentation"], strict=True)):
                demo: Any = file[f"data/demo_{i}"]
                for group, rows in (("obs", slice(None, -1)), ("next_obs", slice(1, None))):
                    there = demo[f"{group}/front_depth"][:]
                    assert there.shape == (*depth[rows].shape, 1)
                    if scale == 3.0:
                        np.testing.assert_allclose(there[..., 0] * np.float32(3), depth[rows], rtol=2.0**-23)
                    else:
                        same(there * np.float32(scale), depth[rows])
                    same(demo[f"{group}/front_segmentation"][:], entities[rows])
    assert "cube" in [one["name"] for one in said["front_segmentation"]["legend"]]


def test_depth_of_rlds(run: Path, recorded: dict[str, list[Array]], tmp_path: Path) -> None:
    export([run], "rlds-ready", tmp_path / "out", {"images": False, "states": True})
    about = json.loads((tmp_path / "out/features.json").read_text())
    depth, entities = (about["images"][f"observation/front_{name}"] for name in ("depth", "segmentation"))
    assert (depth["shape"], depth["dtype"], depth["unit"]) == ([32, 48, 1], "float32", "m")
    assert (entities["dtype"], "cube" in [one["name"] for one in entities["legend"]]) == ("uint16", True)
    for i, path in enumerate(committed(run)):
        folder = tmp_path / "out" / "episodes" / f"{i:06d}"
        for t in range(0, open_trajectory(path).manifest.steps, 7):
            with Image.open(folder / "front_depth" / f"{t:06d}.png") as image:
                same(np.asarray(image).view("<f4")[..., 0], recorded["depth"][i][t])
            with Image.open(folder / "front_segmentation" / f"{t:06d}.png") as image:
                same(np.asarray(image).astype(np.uint16), recorded["segmentation"][i][t])
        with np.load(folder / "steps.npz") as arrays:
            there = arrays["observation/state_joint_pos"]
        np.testing.assert_array_equal(there, open_trajectory(path).states_from_reset("joint_pos")[:-1])


def test_depth_of_webdataset(run: Path, recorded: dict[str, list[Array]], tmp_path: Path) -> None:
    export([run], "webdataset", tmp_path / "out", {"images": False})
    said = json.loads((tmp_path / "out/channels.json").read_text())
    assert (said["front_depth"]["unit"], said["front_depth"]["dtype"]) == ("m", "float32")
    with tarfile.open(tmp_path / "out/shard-000000.tar") as tar:
        for t in range(0, len(recorded["depth"][0]) - 1, 5):
            for name, expected in recorded.items():
                file = tar.extractfile(f"000000_{t:06d}.front_{name}.npz")
                assert file is not None
                with np.load(io.BytesIO(file.read())) as arrays:
                    same(arrays[name], expected[0][t])


def test_depth_of_lerobot(run: Path, recorded: dict[str, list[Array]], tmp_path: Path) -> None:
    """As images of one channel, in metres; statistics are of what LeRobot's loader gives."""
    export([run], "lerobot", tmp_path / "out", {"images": False, "channels": True})
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    said = info["features"]["observation.images.front_depth"]
    assert (said["dtype"], said["shape"], said["info"]["unit"]) == ("image", [32, 48, 1], "m")
    frames = pq.read_table(tmp_path / "out/data/chunk-000/file-000.parquet").to_pydict()
    for name, dtype in (("depth", np.float32), ("segmentation", np.uint16)):
        expected = np.concatenate([rows[:-1] for rows in recorded[name]])
        files = frames[f"observation.images.front_{name}"]
        assert len(files) == len(expected)
        for t in range(0, len(expected), 9):
            with Image.open(io.BytesIO(files[t]["bytes"])) as image:
                same(np.asarray(image).astype(dtype), expected[t])
    stats = json.loads((tmp_path / "out/meta/stats.json").read_text())["observation.images.front_depth"]
    every = np.concatenate([rows[:-1] for rows in recorded["depth"]])
    assert np.shape(stats["mean"]) == (1, 1, 1)
    assert np.ravel(stats["max"])[0] == every.max()
    assert np.ravel(stats["mean"])[0] == pytest.approx(every.mean(), rel=0.02)  # of a hundred frames each


def test_streams_of_two_runs_must_be_alike_where_they_are_taken(run: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    for path in committed(run)[:1]:
        copy = other / "episodes" / path.name
        copy.mkdir(parents=True)
        for file in path.iterdir():
            (copy / file.name).write_bytes(file.read_bytes())
        manifest = json.loads((copy / "manifest.json").read_text())
        manifest["streams"]["camera/front/depth"]["about"]["far"] = 7.0
        (copy / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(RecordError, match="have other streams; export them one by one"):
        export([run, other], "webdataset", tmp_path / "out")
    export([run, other], "webdataset", tmp_path / "out", {"images": False, "channels": False})


def test_two_things_of_one_name_are_refused() -> None:
    one = recording()
    layout = one.layout.model_copy(update={"obs": {"front_depth": one.layout.obs["policy"]}})
    data = DataSet([one.model_copy(update={"layout": layout})], {})
    for form in ("robomimic", "rlds-ready"):
        with pytest.raises(RecordError, match=r"would both be called 'front_depth'.*--option channels=false"):
            made(form, {})[0].check(data)
        made(form, {"channels": False})[0].check(data)

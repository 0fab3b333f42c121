"""Exports of a short run: what they hold, the same bytes after a kill, and what is refused."""

import io
import json
import shutil
import signal
import subprocess
import sys
import tarfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest

from anysim.errors import RecordError, SpecError
from anysim.record.reader import open_trajectory
from anysim_export.api import Episode
from anysim_export.job import export
from anysim_export.lerobot.stats import ImageStats, sampled, stats_of, together
from anysim_export.lerobot.tables import file_name, filled
from anysim_export.tape import play, read_tape
from tests.external_packages import EXTERNAL, FOUND, install, offered, run as run_python
from tests.plugins.export.runs import committed

pytestmark = pytest.mark.xdist_group("export")  # one recording for all tests of exports

MAIN = "from anysim.cli.main import main; main()"
FORMS = ("lerobot", "robomimic", "webdataset")
OPTIONS: dict[str, dict[str, Any]] = {"lerobot": {"channels": True}}

KILLED = """
import json, os, signal, sys
from pathlib import Path
from anysim import registry
from anysim_export.job import export

run, to, out, moment, options = sys.argv[1:]
made = registry.load("exporters", to)
whole = getattr(made, moment)

def killed(self, folder, part, data):
    if moment == "write_episode" and part.index == 0:
        return whole(self, folder, part, data)
    whole(self, folder, part, data)
    first = sorted(path for path in folder.rglob("*") if path.is_file())[0]
    first.write_bytes(first.read_bytes()[: first.stat().st_size // 2])
    os.kill(os.getpid(), signal.SIGKILL)

setattr(made, moment, killed)
export([Path(run)], to, Path(out), json.loads(options))
"""
"""A program that is killed while it writes the second episode, or all of them together: what it wrote is cut short."""


@pytest.fixture(scope="module")
def exported(run: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The data sets of all forms."""
    folder = tmp_path_factory.mktemp("exported")
    for form in FORMS:
        export([run], form, folder / form, OPTIONS.get(form))
    return {form: folder / form for form in FORMS}


@pytest.fixture(scope="module")
def episodes(run: Path) -> list[Episode]:
    """What was recorded."""
    return [Episode(i, open_trajectory(path)) for i, path in enumerate(committed(run))]


def content(directory: Path) -> dict[str, bytes]:
    """The bytes of all files."""
    return {str(p.relative_to(directory)): p.read_bytes() for p in sorted(directory.rglob("*")) if p.is_file()}


def test_an_episode_pairs_what_was_observed_with_the_action_that_followed(run: Path, episodes: list[Episode]) -> None:
    reader, one = open_trajectory(committed(run)[0]), episodes[0]
    np.testing.assert_array_equal(one.obs["policy"][0], reader.initial_obs["policy"])
    np.testing.assert_array_equal(one.obs["policy"][1:], reader.obs["policy"])
    assert one.tasks[0] == "Lift the cube to the goal and come to rest."
    assert one.segments[0] == "pick: grasp: approach"
    assert one.segments[-1] == "pick: bring: carry"
    recorded, shown = dict(reader.images("front")), list(one.images("front"))
    assert len(shown) == one.steps + 1
    assert reader.manifest.cameras["front"].every == 2
    np.testing.assert_array_equal(shown[4], recorded[4])
    np.testing.assert_array_equal(shown[5], recorded[4])  # it holds


def test_robomimic(exported: dict[str, Path], episodes: list[Episode]) -> None:
    """The layout that robomimic's SequenceDataset and its env reading expect, and every value."""
    with h5py.File(exported["robomimic"] / "demo.hdf5") as file:
        data: Any = file["data"]
        assert sorted(data) == ["demo_0", "demo_1", "demo_2"]
        assert data.attrs["total"] == sum(one.steps for one in episodes)
        env = json.loads(data.attrs["env_args"])
        assert set(env) == {"env_name", "type", "env_kwargs"}
        assert env["env_name"] == "anysim_learning.envs:anysim/pick_cube-v0"
        mask: Any = file["mask/train"]
        assert [name.decode() for name in mask[:]] == ["demo_0", "demo_1", "demo_2"]
        layout = json.loads(data.attrs["state_layout"])
        for i, one in enumerate(episodes):
            demo = data[f"demo_{i}"]
            assert demo.attrs["num_samples"] == one.steps
            words = {"instructions": one.tasks, "sub_tasks": one.segments}
            assert {"actions", "rewards", "dones", "states", "obs", "next_obs", *words} == set(demo)
            for name, said in words.items():
                assert [row.decode() for row in demo[name][:]] == list(said)
            pictures = {"front_image", "front_depth", "front_segmentation", "wrist_image"}
            assert set(demo["obs"]) == set(demo["next_obs"]) == {"policy", "privileged", *pictures}
            assert demo.attrs["status"] == "success"
            assert all(len(rows) == one.steps for group in ("obs", "next_obs") for rows in demo[group].values())
            np.testing.assert_array_equal(demo["actions"], one.actions)
            np.testing.assert_array_equal(demo["rewards"], one.rewards)
            assert demo["dones"][:].tolist() == [0] * (one.steps - 1) + [1]
            np.testing.assert_array_equal(demo["obs/policy"], one.obs["policy"][:-1])
            np.testing.assert_array_equal(demo["next_obs/policy"], one.obs["policy"][1:])
            images = list(one.images("wrist"))
            np.testing.assert_array_equal(demo["obs/wrist_image"], images[:-1])
            np.testing.assert_array_equal(demo["next_obs/wrist_image"], images[1:])
            start = 0
            for name, shape in layout.items():
                width = int(np.prod(shape))
                there = demo["states"][:, start : start + width]
                np.testing.assert_array_equal(there, one.states[name][:-1].reshape(one.steps, -1))
                start += width
            assert demo["states"].shape == (one.steps, start)


def test_lerobot(exported: dict[str, Path], episodes: list[Episode]) -> None:
    """The files of v3.0 agree with each other and with the recording."""
    out = exported["lerobot"]
    info = json.loads((out / "meta/info.json").read_text())
    total = sum(one.steps for one in episodes)
    assert (info["codebase_version"], info["fps"], info["robot_type"]) == ("v3.0", 50, "panda")
    assert (info["total_episodes"], info["total_frames"], info["splits"]) == (3, total, {"train": "0:3"})
    assert info["features"]["observation.images.wrist"]["shape"] == [32, 34, 3]  # even sides
    assert "observation.environment_state" not in info["features"]
    frames = pq.read_table(out / "data/chunk-000/file-000.parquet").to_pydict()
    assert frames["index"] == list(range(total))
    for name in ("action", "observation.state"):
        rows = [one.actions if name == "action" else one.obs["policy"][:-1] for one in episodes]
        np.testing.assert_array_equal(np.array(frames[name], np.float32), np.concatenate(rows).astype(np.float32))
    ends = np.cumsum([one.steps for one in episodes]) - 1
    assert np.flatnonzero(frames["next.success"]).tolist() == np.flatnonzero(frames["next.done"]).tolist()
    assert np.flatnonzero(frames["next.success"]).tolist() == ends.tolist()
    tasks = pq.read_table(out / "meta/tasks.parquet").to_pydict()
    assert tasks == {"task_index": [0], "__index_level_0__": ["Lift the cube to the goal and come to rest."]}
    subtasks = pq.read_table(out / "meta/subtasks.parquet").to_pydict()["__index_level_0__"]
    assert [subtasks[i] for i in frames["subtask_index"]] == [s for one in episodes for s in one.segments]
    rows = pq.read_table(out / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    key = "videos/observation.images.front"
    for row, one in zip(rows, episodes, strict=True):
        assert row["dataset_to_index"] - row["dataset_from_index"] == row["length"] == one.steps
        assert row[f"{key}/from_timestamp"] == pytest.approx(row["dataset_from_index"] / 50)
        assert row[f"{key}/to_timestamp"] == pytest.approx(row["dataset_to_index"] / 50)


def test_its_videos_show_the_recorded_images_at_their_times(exported: dict[str, Path], episodes: list[Episode]) -> None:
    import av

    path = exported["lerobot"] / "videos/observation.images.front/chunk-000/file-000.mp4"
    images = [image for one in episodes for image in list(one.images("front"))[:-1]]
    with av.open(str(path)) as video:
        decoded = list(video.decode(video=0))
    assert len(decoded) == len(images)
    for t, (frame, image) in enumerate(zip(decoded, images, strict=True)):
        assert frame.time == pytest.approx(t / 50)
        assert np.abs(frame.to_ndarray(format="rgb24").astype(int) - image).mean() < 5.0


def test_webdataset(exported: dict[str, Path], episodes: list[Episode]) -> None:
    """Samples follow one another, their files together, without times or owners."""
    from PIL import Image

    with tarfile.open(exported["webdataset"] / "shard-000000.tar") as tar:
        members = tar.getmembers()
        assert {(m.mtime, m.uid, m.uname) for m in members} == {(0, 0, "")}
        names = [m.name for m in members[:6]]
        kinds = ("json", "npz", "front.png", "wrist.png", "front_depth.npz", "front_segmentation.npz")
        assert names == [f"000000_000000.{kind}" for kind in kinds]
        read = {m.name: tar.extractfile(m).read() for m in members[:6]}
    assert len(members) == 6 * sum(one.steps for one in episodes)
    about = json.loads(read[names[0]])
    assert about["instruction"] == episodes[0].tasks[0]
    assert (about["status"], about["annotation"]["phase"]) == ("running", "grasp: approach")
    assert about["language/narration"] == next(episodes[0].held("language/narration"))
    with np.load(io.BytesIO(read[names[1]])) as arrays:
        np.testing.assert_array_equal(arrays["action"], episodes[0].actions[0])
    shown = np.asarray(Image.open(io.BytesIO(read[names[2]])))
    np.testing.assert_array_equal(shown, next(episodes[0].images("front")))


@pytest.mark.parametrize(
    ("form", "moment"),
    [
        ("lerobot", "write_episode"),
        pytest.param("lerobot", "assemble", marks=pytest.mark.slow),
        pytest.param("robomimic", "write_episode", marks=pytest.mark.slow),
        pytest.param("robomimic", "assemble", marks=pytest.mark.slow),
        pytest.param("webdataset", "write_episode", marks=pytest.mark.slow),
        pytest.param("webdataset", "assemble", marks=pytest.mark.slow),
    ],
)
def test_killed_it_goes_on_to_the_same_bytes(
    run: Path, exported: dict[str, Path], tmp_path: Path, form: str, moment: str
) -> None:
    out = tmp_path / form
    options = OPTIONS.get(form, {})
    command = [sys.executable, "-c", KILLED, str(run), form, str(out), moment, json.dumps(options)]
    assert subprocess.run(command, check=False, timeout=120).returncode == -signal.SIGKILL
    assert not out.exists()
    done = export([run], form, out, options)
    assert done.resumed == (1 if moment == "write_episode" else 3)
    assert content(out) == content(exported[form])
    assert [path.name for path in tmp_path.iterdir()] == [form]


PARENT_KILLED = """
import json, os, signal, sys, threading, time
from pathlib import Path
from anysim_export.job import export

if __name__ == "__main__":
    run, to, out, _, options = sys.argv[1:]
    parts = Path(out).with_name(f".{Path(out).name}.export") / "parts"
    def watch():
        while not any(parts.glob("*.new/*")):
            time.sleep(0.001)
        os.kill(os.getpid(), signal.SIGKILL)
    threading.Thread(target=watch).start()
    export([Path(run)], to, Path(out), json.loads(options), jobs=2)
"""
"""A program that is killed while its two processes write; they end a second later."""


@pytest.mark.parametrize(
    "form", ["webdataset", *(pytest.param(form, marks=pytest.mark.slow) for form in ("lerobot", "robomimic"))]
)
def test_two_processes_write_the_same_bytes_and_killed_too(
    run: Path, exported: dict[str, Path], tmp_path: Path, form: str
) -> None:
    out, options, program = tmp_path / form, OPTIONS.get(form, {}), tmp_path / "program.py"
    program.write_text(PARENT_KILLED)
    command = [sys.executable, str(program), str(run), form, str(out), "", json.dumps(options)]
    assert subprocess.run(command, check=False, timeout=120).returncode == -signal.SIGKILL
    assert not out.exists()
    export([run], form, out, options, jobs=2)
    assert content(out) == content(exported[form])
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([form, "program.py"])


def test_what_another_export_left_aside_is_not_taken(run: Path, exported: dict[str, Path], tmp_path: Path) -> None:
    out = tmp_path / "webdataset"
    command = [sys.executable, "-c", KILLED, str(run), "webdataset", str(out), "assemble", "{}"]
    subprocess.run(command, check=False, timeout=120)
    assert export([run], "webdataset", out, {"images": False}).resumed == 0
    assert content(out) != content(exported["webdataset"])


def test_what_died_after_its_data_set_was_there_is_cleared(run: Path, tmp_path: Path) -> None:
    out, aside = tmp_path / "webdataset", tmp_path / ".webdataset.export"
    export([run], "webdataset", out, {"images": False})
    (aside / "parts" / "000000").mkdir(parents=True)
    assert export([run], "webdataset", out, {"images": False}).present
    assert list(tmp_path.iterdir()) == [out]


def test_what_is_there_stays(run: Path, exported: dict[str, Path], tmp_path: Path) -> None:
    before = content(exported["webdataset"])
    assert export([run], "webdataset", exported["webdataset"]).present
    with pytest.raises(RecordError, match=r"holds another export \('webdataset', 3 episodes; other options\); nothing"):
        export([run], "webdataset", exported["webdataset"], {"images": False})
    (tmp_path / "mine").mkdir()
    with pytest.raises(RecordError, match="mine is there and is no data set of `anysim export`; nothing is"):
        export([run], "webdataset", tmp_path / "mine")
    assert content(exported["webdataset"]) == before


def test_what_cannot_be_exported(run: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordError, match="empty holds no trajectory"):
        export([tmp_path / "empty"], "webdataset", tmp_path / "out")
    with pytest.raises(SpecError, match=r"options\.shard_md: unknown key.*shard_mb"):
        export([run], "webdataset", tmp_path / "out", {"shard_md": 3})
    copy = Path(shutil.copytree(run, tmp_path / "copy"))
    path = committed(copy)[1]
    manifest = json.loads((path / "manifest.json").read_text())
    (path / "manifest.json").write_text(json.dumps(manifest | {"status": "failed"}))
    steps = sum(open_trajectory(p).manifest.steps for p in committed(copy))
    assert export([copy], "webdataset", tmp_path / "two", {"images": False})[1:5] == (2, steps, 0, 1)
    video = path / "front.mp4"
    video.write_bytes(video.read_bytes()[:-1] + b"x")
    with pytest.raises(RecordError, match=r"front\.mp4 is not the file that was committed; `anysim verify"):
        export([copy], "webdataset", tmp_path / "three", failed_too=True)
    assert not (tmp_path / "three").exists()


def test_a_tape_comes_to_the_same_success(exported: dict[str, Path], episodes: list[Episode], tmp_path: Path) -> None:
    """Actions out to LeRobot's files and back: every episode begins as it was recorded, and succeeds as it did."""
    tape = read_tape(exported["lerobot"])
    played = list(play(tape))
    assert [(one.status, one.recorded) for one in played] == [("success", "success")] * 3
    assert [one.steps for one in played] == [one.steps for one in episodes]
    foreign = tape._replace(sheet=None)
    with pytest.raises(RecordError, match=r"no anysim\.json\); name the task to play in with --task"):
        next(play(foreign))
    assert next(play(foreign, task="pick_cube")).recorded == ""
    with pytest.raises(
        RecordError, match=r"has 30 actions a second; 'pick_cube' takes 50\. Name a task with this rate"
    ):
        next(play(foreign._replace(fps=30.0), task="pick_cube"))
    with pytest.raises(RecordError, match=r"is no data set of LeRobot: it has no meta/info\.json"):
        read_tape(exported["robomimic"])


def test_the_commands(run: Path, tmp_path: Path) -> None:
    out = tmp_path / "data"
    words = ["export", str(run), "--to", "lerobot", "--out", str(out), "--option", "images=false"]
    first, again = (run_python(tmp_path, "-c", MAIN, *words) for _ in range(2))
    assert first.returncode == 0, first.stderr
    assert "3 episodes" in first.stdout
    assert "recorded, and not in it: state/" in first.stdout
    assert "camera/front/depth front/segmentation (--option channels=true)" in first.stdout
    assert "are there already in" in again.stdout
    told = json.loads(run_python(tmp_path, "-c", MAIN, "tape", str(out), "--json").stdout)
    assert (told["success"], told["as_recorded"]) == (3, 3)
    refused = run_python(tmp_path, "-c", MAIN, "tape", str(out), "--seed", "3")
    assert refused.returncode == 2
    assert "goes with --task" in refused.stderr


def test_statistics_of_known_numbers() -> None:
    rows = np.arange(1001.0)[:, None] * [1.0, -2.0]
    stats = stats_of(rows)
    np.testing.assert_allclose(stats["mean"], [500.0, -1000.0])
    np.testing.assert_allclose(stats["std"], rows.std(axis=0))
    np.testing.assert_allclose(stats["q10"], [100.1, -1800.0], atol=1.0)
    halves = together([stats_of(rows[:400]), stats_of(rows[400:])])
    for name in ("min", "max", "mean", "std", "count"):
        np.testing.assert_allclose(halves[name], stats[name])
    image = np.random.default_rng(0).integers(0, 256, (20, 30, 3), np.uint8)
    counted = ImageStats()
    counted.add(image)
    flat = stats_of(image.reshape(-1, 3) / 255.0)
    for name, values in counted.stats().items():
        if name != "count":
            np.testing.assert_allclose(values.ravel(), flat[name], atol=1e-3 if name.startswith("q") else 1e-12)
    assert len(sampled(30)) == 30
    assert len(sampled(1000)) == 177


def test_files_are_filled_and_chunked() -> None:
    assert filled([40, 40, 40, 120, 10], 100) == [0, 0, 1, 2, 3]
    assert file_name(2001, "mp4") == "chunk-002/file-001.mp4"


def test_an_exporter_of_a_stranger(run: Path, tmp_path: Path) -> None:
    """Found by its entry point, with its option; resumable and refused as ours are, for it does nothing about it."""
    site = install("anysim-ledger", tmp_path / "site")
    assert offered("anysim-ledger") == {"exporters": ["ledger"]}
    assert json.loads(run_python(site, "-c", FOUND, "anysim-ledger").stdout) == {"exporters": ["ledger"]}
    words = ("-c", MAIN, "export", str(run), "--to", "ledger", "--out", "out", "--option", "digits=1")
    told = run_python(site, *words, cwd=tmp_path)
    assert told.returncode == 0, told.stderr
    rows = (tmp_path / "out" / "returns.csv").read_text().splitlines()
    assert rows[0] == "episode,steps,return,instruction"
    assert len(rows) == 4
    assert json.loads((tmp_path / "out" / "anysim.json").read_text())["package"] == "anysim-ledger"
    assert (EXTERNAL / "anysim-ledger" / "README.md").exists()

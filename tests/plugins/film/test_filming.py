"""Films of recorded trajectories: in the trajectory as a live recording has them, or beside it, whole or not at all."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim.errors import RecordError
from anysim.record.incoming import FileLock
from anysim.record.manifest import read_manifest
from anysim.record.names import MANIFEST_FILE, trajectories
from anysim.record.reader import open_trajectory
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_drawing
from anysim_film import commit
from anysim_film.episode import moments_for
from anysim_film.filmer import Filmer, film_all, film_targets
from anysim_film.sheet import FILM_FILE, read_sheet
from anysim_film.stage import FilmOrder
from anysim_inspect.verify import verify
from anysim_mcap.video import images
from anysim_recording.collector import Collector
from tests import forked
from tests.record.test_film import SEEN, filmed_env, recorded as played

SHORT = (*SEEN, "task.horizon=6", "record.keep=all", "record.fps=25")
BOTH = FilmOrder(("front", "wrist"))


def collect(out: Path, engine: str, *more: str) -> list[Path]:
    """Two short episodes with looks of their own."""
    require_drawing(engine)
    with anysim.make("pick_cube", engine=engine, num_envs=2, overrides=[*SHORT, *more]) as env:
        list(Collector(env, SkillPolicy(env), out, 2, 0).run())
    return trajectories(out)


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Trajectories with the videos of both cameras, as they were recorded."""
    return collect(tmp_path_factory.mktemp("live"), "mujoco", "record.film=live")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The same without videos; not to be written to."""
    return collect(tmp_path_factory.mktemp("blind"), "mujoco", "record.cameras=[]")


@pytest.fixture
def blind(recorded: list[Path], tmp_path: Path) -> list[Path]:
    """A copy of them."""
    return [Path(shutil.copytree(path, tmp_path / "run" / "episodes" / path.name)) for path in recorded]


def left_aside(path: Path) -> list[str]:
    """What filming left beside a directory."""
    return [p.name for p in path.parent.iterdir() if p.name.startswith(".")]


def test_videos_made_later_are_the_videos_of_the_recording(live: list[Path], blind: list[Path]) -> None:
    """The same bytes, described by the same entries of the manifest; and what was there stays as it was."""
    with Filmer(BOTH) as filmer:
        for path, wanted in zip(blind, live, strict=True):
            before = read_manifest(path)
            film = filmer.film(path)
            assert film.cameras == ("front", "wrist")
            assert film.frames == 8
            ours, theirs = read_manifest(path), read_manifest(wanted)
            assert ours.cameras == theirs.cameras
            for camera in theirs.cameras.values():
                assert (path / camera.file).read_bytes() == (wanted / camera.file).read_bytes()
                assert ours.files[camera.file] == theirs.files[camera.file]
            changed = {"cameras", "files", "clock"}
            assert ours.model_dump(exclude=changed) == before.model_dump(exclude=changed)
            assert set(ours.clock["filmed"]) == {"front", "wrist"}
            assert ours.clock["filmed"]["front"]["engine"] == f"mujoco {ours.engine_version}"
            assert verify(path) == []
            assert [step for step, _ in open_trajectory(path).images("wrist")] == [0, 2, 4, 6]
            assert left_aside(path) == []


def test_what_is_there_is_passed_over(blind: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """A second call draws what the first left, a third nothing, and for nothing no engine is made."""
    path = blind[0]
    with Filmer(FilmOrder(("front",))) as filmer:
        assert filmer.film(path).cameras == ("front",)
    one = (path / "front.mp4").stat()
    with Filmer(BOTH) as filmer:
        film = filmer.film(path)
    assert (film.cameras, film.present, film.frames) == (("wrist",), ("front",), 4)
    assert (path / "front.mp4").stat() == one
    assert list(read_manifest(path).clock["filmed"]) == ["front", "wrist"]
    monkeypatch.setattr("anysim.api.make", lambda *_, **__: pytest.fail("an engine was made"))
    with Filmer(BOTH) as filmer:
        assert filmer.film(path).cameras == ()


def test_a_crash_leaves_the_trajectory_readable_and_the_next_call_repairs_it(
    blind: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the videos and the manifest that names them."""
    path, before = blind[0], read_manifest(blind[0])
    replace = Path.replace

    def stop(self: Path, target: Path) -> Path:
        if target.name == MANIFEST_FILE:
            raise OSError(28, "No space left on device", str(target))
        return replace(self, target)

    with monkeypatch.context() as patch, Filmer(BOTH) as filmer:
        patch.setattr(Path, "replace", stop)
        with pytest.raises(RecordError, match=r"No space left on device .*start it again"):
            filmer.film(path)
    assert read_manifest(path) == before
    assert len(open_trajectory(path).actions) == 6
    assert "files that its manifest doesn't know: front.mp4, wrist.mp4" in verify(path)[0]
    with Filmer(BOTH) as filmer:
        filmer.film(path)
    assert verify(path) == []
    assert left_aside(path) == []


def test_a_killed_process_leaves_nothing_in_the_way(blind: list[Path]) -> None:
    path = blind[0]
    aside = path.with_name(f".{path.name}.film")
    aside.mkdir()
    (aside / "front.mp4").write_bytes(b"half a video")
    with Filmer(FilmOrder(("front",))) as filmer:
        assert filmer.film(path).frames == 4
    assert verify(path) == []
    assert left_aside(path) == []


def test_one_process_at_a_time(blind: list[Path]) -> None:
    path = blind[0]
    lock = FileLock.take(path.with_name(f".{path.name}.film.lock"))
    assert lock is not None
    with lock, Filmer(BOTH) as filmer, pytest.raises(RecordError, match=r"another process films .*wait for it"):
        filmer.film(path)


def test_only_recorded_cameras_go_into_a_trajectory(blind: list[Path]) -> None:
    """Whatever else is ordered goes into another directory; and nothing that is damaged is filmed."""
    path = blind[0]
    orders = (
        FilmOrder(engine="pybullet"), FilmOrder(size=(64, 48)), FilmOrder(fps=10.0),
        FilmOrder(overrides=("world.objects.cube.color=red",)),
    )  # fmt: skip
    for order in orders:
        with Filmer(order) as filmer, pytest.raises(RecordError, match="pass --out DIR"):
            filmer.film(path)
    manifest = json.loads((path / MANIFEST_FILE).read_text())
    (path / MANIFEST_FILE).write_text(json.dumps(manifest | {"world_hash": "0" * 64}))
    with Filmer(BOTH) as filmer, pytest.raises(RecordError, match=r"cannot be rebuilt as it was .* pass --out DIR"):
        filmer.film(path)
    (path / MANIFEST_FILE).write_text(json.dumps(manifest))
    with (path / "trajectory.mcap").open("ab") as file:
        file.write(b"more")
    with Filmer(BOTH) as filmer, pytest.raises(RecordError, match=r"trajectory\.mcap is not what was committed"):
        filmer.film(path)
    assert not (path / "front.mp4").exists()
    assert left_aside(path) == []


def test_cameras_that_cannot_be_filmed(blind: list[Path]) -> None:
    for order, words in (
        (FilmOrder(("frond",)), "there is no camera 'frond'; did you mean 'front'"),
        (FilmOrder(("front",), overrides=("world.cameras.front.channels=[depth]",)), "gives no colours"),
    ):
        with Filmer(order) as filmer, pytest.raises(RecordError, match=words):
            filmer.film(blind[0], blind[0].parent / "films")


def test_films_beside_a_trajectory(blind: list[Path], tmp_path: Path) -> None:
    """Other looks, sizes, cameras and lights, with a sheet of what; the same order goes on, another one is refused."""
    path, out = blind[0], tmp_path / "films" / "a"
    changes = (
        "world.objects.cube.color=magenta",
        "world.objects.rod={source: {box: [0.1, 0.1, 0.1]}, fixed: true}",
        "world.layout.rod={position: [0.2, 0.4, 0.6]}",
        "world.cameras.above={from: [0.3, 0.0, 2.0], look_at: table}",
    )
    with Filmer(FilmOrder(("front", "above"), "pybullet", changes, (64, 48), 50.0)) as filmer:
        film = filmer.film(path, out)
    assert (film.cameras, film.frames, film.still, film.directory) == (("front", "above"), 14, ("rod",), out)
    sheet, manifest = read_sheet(out), read_manifest(path)
    assert sheet is not None
    assert (sheet.engine, sheet.still, sheet.final_digest) == ("pybullet", ("rod",), manifest.final_digest)
    assert (sheet.cameras["front"].width, sheet.cameras["front"].every) == (64, 1)
    assert set(sheet.files) == {"above.mp4", "front.mp4"} == {p.name for p in out.iterdir()} - {FILM_FILE}
    assert manifest.cameras == {}
    with Filmer(FilmOrder(("front", "above"), "pybullet", changes, (64, 48), 50.0)) as filmer:
        assert filmer.film(path, out).present == ("front", "above")
    for other, source in ((changes[1:], path), (changes, blind[1])):
        with (
            Filmer(FilmOrder(("front",), "pybullet", other, (64, 48), 50.0)) as filmer,
            pytest.raises(RecordError, match="holds videos of something else"),
        ):
            filmer.film(source, out)
    dark = ("world.lights.key.intensity=0.0", "world.scenery.ambient=[0.0, 0.0, 0.0]")
    with Filmer(FilmOrder(("above",), "pybullet", (*changes, *dark), (64, 48), 50.0)) as filmer:
        filmer.film(path, tmp_path / "dark")
    lit, unlit = (
        np.stack([*images(folder / "above.mp4", 64, 48)]).astype(float) for folder in (out, tmp_path / "dark")
    )
    red, green, blue = np.moveaxis(lit, -1, 0)
    assert ((red > green + 60) & (blue > green + 60)).any(axis=(1, 2)).all(), "the cube is not seen from above"
    assert unlit.mean() < 0.05 * lit.mean()


def test_each_trajectory_has_a_place_of_its_own(tmp_path: Path) -> None:
    one, two = (tmp_path / run / "episodes" / "env_0000_episode_0000" for run in ("one", "two"))
    assert film_targets([one], None) == [(one, None)]
    assert film_targets([one], tmp_path) == [(one, tmp_path / one.name)]
    assert [place for _, place in film_targets([one, two], tmp_path)] == [
        tmp_path / "one" / one.name,
        tmp_path / "two" / two.name,
    ]
    with pytest.raises(RecordError, match="film them one by one"):
        film_targets([one, one], tmp_path)


def test_the_workspace_is_gone_after_an_error(tmp_path: Path) -> None:
    def work() -> None:
        with commit.workspace(tmp_path / "film") as aside:
            (aside / "front.mp4").write_bytes(b"half a video")
            raise KeyError

    with pytest.raises(KeyError):
        work()
    assert list(tmp_path.iterdir()) == []


def test_bodies_go_by_name() -> None:
    """A world with a thing more draws the recorded ones where they were, and the thing where its reset put it."""
    more = (
        "world.objects.post={source: {box: [0.05, 0.05, 0.4]}, fixed: true}",
        "world.layout.post={position: [0.2, 0.4, 0.6]}",
    )
    with filmed_env("mujoco", 1) as env, filmed_env("mujoco", 1, *more) as other:
        env.reset(seed=5)
        names = [body.name for body in env.engine.world.bodies]
        _, poses = played(env, 3)
        other.reset(episode_seeds=[int(env.streams.episode_seed[0])])
        moments = moments_for(other, names, np.arange(4), poses[0])
        theirs = [body.name for body in other.engine.world.bodies]
        assert {"post"} == set(theirs) - set(names)
        for name in names:
            assert np.array_equal(moments.body_pose[:, theirs.index(name)], poses[0][:, names.index(name)])
        assert (moments.body_pose[:, theirs.index("post"), :3] == [0.2, 0.4, 0.6]).all()


# ---------------------------------------------------------------------- other processes


@pytest.mark.slow
def test_several_processes_make_the_same_videos(live: list[Path], blind: list[Path]) -> None:
    films = list(film_all([(path, None) for path in blind], BOTH, jobs=2))
    assert {film.trajectory for film in films} == set(blind)
    for path, wanted in zip(blind, live, strict=True):
        assert all((path / f).read_bytes() == (wanted / f).read_bytes() for f in ("front.mp4", "wrist.mp4"))
    with pytest.raises(RecordError, match="there is no camera 'frond'"):
        list(film_all([(path, None) for path in blind], FilmOrder(("frond",)), jobs=2))


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_another_process_makes_the_videos_of_the_recording(engine: str, tmp_path: Path) -> None:
    """Lossless ones, so that every pixel counts: recorded in this process, drawn by the command line in another one."""
    lossless = "record.options={crf: 0, preset: ultrafast}"
    wanted = collect(tmp_path / "live", engine, lossless, "record.film=live")
    blind = collect(tmp_path / "blind", engine, lossless, "record.cameras=[]")
    command = [sys.executable, "-m", "anysim.cli", "render", str(tmp_path / "blind"), "--json"]
    done = subprocess.run([*command, "-c", "front", "-c", "wrist"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["images"] == 16
    for path, theirs in zip(blind, wanted, strict=True):
        for camera in ("front", "wrist"):
            ours = [image for _, image in open_trajectory(path).images(camera)]
            assert np.array_equal(ours, [image for _, image in open_trajectory(theirs).images(camera)])
            assert (path / f"{camera}.mp4").read_bytes() == (theirs / f"{camera}.mp4").read_bytes()
        assert verify(path) == []


def test_the_command(blind: list[Path], tmp_path: Path) -> None:
    """One line an episode, one that sums up, JSON, and errors with exit code 2."""

    def render(*words: str) -> subprocess.CompletedProcess[str]:
        return forked.run("-m", "anysim.cli", "render", str(tmp_path / "run"), *words)

    lines = render("--camera", "wrist").stdout.splitlines()
    assert lines[0] == f"{blind[0].name}: wrist, 4 images -> {blind[0]}"
    assert lines[-1] == "2 of 2 episodes filmed, 8 images; the others were there"
    told = json.loads(render("-c", "wrist", "--json").stdout)
    assert (told["filmed"], told["images"], told["trajectories"][1]["present"]) == (0, 0, ["wrist"])
    wrong = render("--size", "64", "48")
    assert wrong.returncode == 2
    assert wrong.stderr.startswith("error: ")
    assert "pass --out DIR" in wrong.stderr

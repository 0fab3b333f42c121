"""Annotations of recorded trajectories: those of the live world, whole beside them, or not at all."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer import Typer
from typer.testing import CliRunner

import anysim
from anysim.errors import AnysimError, RecordError
from anysim.record.commit import describe
from anysim.record.names import trajectories
from anysim.skills.runner import SkillPolicy
from anysim_annotation.capture import Capture
from anysim_annotation.files import json_line, read_array, read_records
from anysim_annotation.orders import read_orders
from anysim_annotation.render import AnnotationMaker, annotate
from anysim_annotation.sheet import SHEET_FILE, read_annotations
from anysim_film.stage import FilmOrder
from anysim_inspect.verify import verify
from anysim_recording.collector import Collector

SMALL = FilmOrder(("front", "wrist"), size=(48, 36), fps=25.0)
NAMES = "boxes_2d,boxes_3d,camera,depth,flow,instance,normals,point_cloud,semantic"
RUN = ("record.cameras=[]", "task.horizon=6", "record.keep=all")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two short episodes without images; not to be written to."""
    out = tmp_path_factory.mktemp("run")
    with anysim.make("pick_cube", num_envs=2, overrides=RUN) as env:
        list(Collector(env, SkillPolicy(env), out, 2, 0).run())
    return trajectories(out)


@pytest.fixture
def run(recorded: list[Path], tmp_path: Path) -> list[Path]:
    """A copy of them."""
    return [Path(shutil.copytree(path, tmp_path / "run" / "episodes" / path.name)) for path in recorded]


def make(paths: list[Path], names: str = NAMES, order: FilmOrder = SMALL, out: Path | None = None):
    with AnnotationMaker(order, read_orders(names), "geometry") as maker:
        return [maker.annotate(path, None if out is None else out / path.name) for path in paths]


def contents(directory: Path) -> dict[str, bytes]:
    """Every file but the sheet, and the sheet without its clock."""
    files = {str(f.relative_to(directory)): f.read_bytes() for f in directory.rglob("*") if f.is_file()}
    sheet = json.loads(files.pop(SHEET_FILE))
    sheet.pop("clock")
    return files | {SHEET_FILE: json.dumps(sheet).encode()}


def test_they_are_beside_the_trajectory_and_described(run: list[Path]) -> None:
    done = make(run)
    for path, one in zip(run, done, strict=True):
        assert one.directory == path.with_name(path.name + ".annotations")
        assert one.frames == 8
        sheet = read_annotations(one.directory)
        assert sheet.steps == (0, 2, 4, 6)
        assert {thing["name"] for thing in sheet.legend["instances"]} == {"panda", "table", "cube"}
        files = {str(f.relative_to(one.directory)) for f in one.directory.rglob("*") if f.is_file()} - {SHEET_FILE}
        assert files == sheet.files.keys()
        assert all(describe(one.directory / name) == entry for name, entry in sheet.files.items())
        assert verify(path) == []
        assert [p.name for p in path.parent.iterdir() if p.name.startswith(".")] == []
    assert trajectories(run[0].parent.parent) == run


def test_they_are_the_labels_of_the_live_world(run: list[Path]) -> None:
    [one] = make(run[:1], out=None)
    small = [f"world.cameras.{name}.size=[48, 36]" for name in ("front", "wrist")]
    live: dict[int, dict] = {}
    with anysim.make("pick_cube", num_envs=2, overrides=[*RUN, *small]) as env:
        policy = SkillPolicy(env)
        capture = Capture(env, {"wrist": NAMES.split(",")}, "geometry")
        env.reset(seed=0)
        ids = np.arange(2)
        policy.begin(ids)
        for step in range(7):
            if step:
                env.step(policy.act(ids))
            if step % 2 == 0:
                live[step] = capture.take()["wrist"]
    sheet = read_annotations(one.directory)
    for name, entry in sheet.cameras["wrist"].annotators.items():
        for key, file in entry.files.items():
            if key == "records":
                lines = (one.directory / file).read_text().splitlines(keepends=True)
                ours = [json_line({"step": k, **r}) for k in live for r in live[k][name].records[0]]
                assert lines == ours, name
                continue
            for step, labels in live.items():
                array = read_array(one.directory, file, step)
                assert array.dtype == np.dtype(entry.arrays[key].dtype)
                assert array.tobytes() == labels[name].arrays[key][0].tobytes(), (name, key, step)


def test_equal_commands_give_equal_bytes_and_what_is_there_is_passed_over(
    run: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = make(run[:1], out=tmp_path / "whole")[0].directory
    parts = tmp_path / "parts"
    make(run[:1], "boxes_2d,instance", out=parts)
    one = make(run[:1], out=parts)[0]
    assert one.present == ("front.boxes_2d", "front.instance", "wrist.boxes_2d", "wrist.instance")
    ours, theirs = contents(one.directory), contents(whole)
    assert ours.keys() == theirs.keys()
    assert [name for name in ours if ours[name] != theirs[name] and name != SHEET_FILE] == []
    monkeypatch.setattr("anysim.api.make", lambda *_, **__: pytest.fail("an engine was made"))
    assert make(run[:1], out=parts)[0].made == ()


def test_a_crash_leaves_nothing_that_is_called_whole(run: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    replace, path = Path.replace, run[0]

    def stop(self: Path, target: Path) -> Path:
        if target.name == SHEET_FILE:
            raise OSError(28, "No space left on device", str(target))
        return replace(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", stop)
        with pytest.raises(RecordError, match=r"No space left on device .*start it again"):
            make([path], "instance,boxes_2d")
    where = path.with_name(path.name + ".annotations")
    assert read_annotations(where) is None
    make([path], "instance,boxes_2d")
    assert len(read_annotations(where).files) == 10
    assert verify(path) == []


def test_other_sources_parameters_and_cameras_are_refused_in_words(run: list[Path]) -> None:
    make(run[:1], "point_cloud")
    with pytest.raises(
        RecordError, match="'point_cloud' of camera 'front' with other parameters; choose another --out"
    ):
        make(run[:1], "{point_cloud: {stride: 2}}")
    with pytest.raises(RecordError, match="holds annotations of something else"):
        make(run[:1], "point_cloud", FilmOrder(("front",), size=(32, 24)))
    with pytest.raises(RecordError, match="there is no camera 'frond'; did you mean 'front'"):
        make(run[:1], "point_cloud", FilmOrder(("frond",)))


def test_the_command_says_what_it_made(command_line: Typer, run: list[Path]) -> None:
    words = [
        "render",
        str(run[0]),
        "-c",
        "front",
        "--size",
        "48",
        "36",
        "--source",
        "geometry",
        "--annotate",
        "boxes_2d",
    ]
    first = CliRunner().invoke(command_line, [*words, "--json"])
    assert first.exit_code == 0, first.exception
    said = json.loads(first.stdout)
    assert (said["annotated"], said["images"]) == (1, 4)
    boxes = read_records(Path(said["trajectories"][0]["directory"]) / "front.boxes_2d.jsonl")
    assert {box["name"] for box in boxes} <= {"panda", "table", "cube"}
    again = CliRunner().invoke(command_line, words)
    assert "0 of 1 episodes annotated" in again.stdout


def test_a_job_of_images_takes_no_option_of_recordings(command_line: Typer, tmp_path: Path) -> None:
    failed = CliRunner().invoke(command_line, ["render", str(tmp_path / "desk.yaml"), "-c", "front"])
    assert isinstance(failed.exception, AnysimError)
    assert str(failed.exception).startswith("--camera: what a job of still images draws stands in")


@pytest.mark.slow
def test_several_processes_make_the_same_labels(run: list[Path], tmp_path: Path) -> None:
    assert len(run) > 1
    found = {
        jobs: {
            one.trajectory.name: contents(one.directory)
            for one in annotate(
                [(path, tmp_path / str(jobs) / path.name) for path in run], SMALL, NAMES, "engine", jobs
            )
        }
        for jobs in (1, 2)
    }
    assert found[1] == found[2]
    assert set(found[1]) == {path.name for path in run}
    with pytest.raises(RecordError, match="there is no camera 'frond'"):
        list(annotate([(path, None) for path in run], FilmOrder(("frond",)), NAMES, "engine", 2))

"""`anysim counterfactual`: pairs that differ in one factor alone, and from when on."""

import json
import shutil
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from anysim.errors import TaskError
from anysim.record.manifest import read_manifest
from anysim.record.reader import open_trajectory
from anysim.record.replay import replay
from anysim.testing.engines import require_engine
from anysim_collect import commands
from anysim_collect.cli.counterfactual import parse_factors, say_pairs
from anysim_collect.divergence_plot import Gap, divergence_picture
from anysim_inspect.verify_runs import verify_all

app = typer.Typer()
commands.add_cli(app)
BLIND = ["record.cameras=[]", "world.cameras.front.channels=[]", "world.cameras.wrist.channels=[]"]
NOISY = (
    "world.sensors={tool: {sensor: joints, robot: panda, rate: 25, delay: {choice: [0, 1]}, dropout: 0.3, "
    "noise: {position: {white: 0.01, walk: 0.001, bias: {range: [-0.02, 0.02]}}}}}"
)


def called(*words: str | Path, sets: tuple[str, ...] = (), code: int = 0, engine: str = "mujoco") -> Any:
    overrides = [word for one in (*BLIND, *sets) for word in ("-o", one)]
    done = CliRunner().invoke(
        app, ["counterfactual", "pick_cube", "-e", engine, *map(str, words), *overrides, "--json"]
    )
    assert done.exit_code == code, done.output
    return json.loads(done.stdout) if code == 0 else done.exception


def episodes(out: Path) -> dict[str, Any]:
    """All that equal trajectories share, with the hashes of their files."""
    return {p.name: read_manifest(p).model_dump(exclude={"clock"}) for p in sorted((out / "episodes").iterdir())}


@pytest.fixture(scope="module")
def slippery(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two pairs whose cubes have another mass, which is felt when they are lifted, with a noisy sensor."""
    out = tmp_path_factory.mktemp("pairs") / "run"
    told = called("--factor", "objects.cube.mass=0.9", "-k", "2", "--actions", "same", "--out", out, sets=(NOISY,))
    assert [pair["episode"] for pair in told["pairs"]] == [0, 1]
    return out


@pytest.mark.slow
def test_one_factor_differs_and_no_other_draw(slippery: Path) -> None:
    for episode in range(2):
        same, changed = (read_manifest(slippery / "episodes" / f"env_000{i}_episode_000{episode}") for i in range(2))
        assert same.episode_seed == changed.episode_seed
        differing = {name for name in same.drawn if same.drawn[name] != changed.drawn[name]}
        assert differing == {"scene/cube/mass"}
        assert changed.overridden == {"world.objects.cube.mass": 0.9}
        assert same.overridden == {"world.objects.cube.mass": same.drawn["scene/cube/mass"]}


@pytest.mark.slow
def test_the_diverging_step_is_the_first_at_which_states_differ_by_more_than_said(slippery: Path) -> None:
    told = json.loads((slippery / "pairs.json").read_text())
    assert told["incomplete"] == []
    for pair in told["pairs"]:
        a, b = (open_trajectory(slippery / "episodes" / pair[key]) for key in ("same", "changed"))
        assert pair["acts_apart"] is None, "both have the same actions"
        step, last = pair["diverges"], min(len(a.actions), len(b.actions))
        assert 0 < step <= last
        fields = ("joint_pos", "joint_vel", "body_pose", "body_twist")
        gap = [max(float(np.abs(a.states[f][t] - b.states[f][t]).max()) for f in fields) for t in range(last)]
        assert max(gap[: step - 1], default=0.0) <= told["tolerance"] < gap[step - 1]


@pytest.mark.slow
def test_losses_and_delays_of_sensors_carry_over_to_the_bit(slippery: Path) -> None:
    """They do not follow from what is read."""
    for pair in json.loads((slippery / "pairs.json").read_text())["pairs"]:
        a, b = (open_trajectory(slippery / "episodes" / pair[key]) for key in ("same", "changed"))
        count = min(len(a.actions), len(b.actions))
        for name in ("sensor_tool_valid", "sensor_tool_time"):
            assert a.states[name][:count].tobytes() == b.states[name][:count].tobytes(), name
        assert not a.states["sensor_tool_valid"].all()


@pytest.mark.slow
def test_pairs_are_whole_trajectories_that_replay(slippery: Path) -> None:
    paths = sorted((slippery / "episodes").iterdir())
    [check] = verify_all(paths)
    assert check.whole
    assert (len(paths), check.left) == (4, [])
    assert all(replay(path).identical for path in paths)
    done = CliRunner().invoke(app, ["report", str(slippery), "--json"])
    assert json.loads(done.stdout)["attempts"] == 4


@pytest.mark.slow
def test_the_same_command_goes_on_where_it_stopped(slippery: Path, tmp_path: Path) -> None:
    out = Path(shutil.copytree(slippery, tmp_path / "run"))
    for name in ("env_0001_episode_0001", "env_0000_episode_0001"):
        shutil.rmtree(out / "episodes" / name)
    (out / "pairs.json").write_text(json.dumps(json.loads((out / "pairs.json").read_text()) | {"pairs": []}))
    called("--factor", "objects.cube.mass=0.9", "-k", "2", "--actions", "same", "--out", out, sets=(NOISY,))
    assert episodes(out) == episodes(slippery)
    assert json.loads((out / "pairs.json").read_text()) == json.loads((slippery / "pairs.json").read_text())
    error = called("--factor", "objects.cube.mass=0.8", "--actions", "same", "--out", out, sets=(NOISY,), code=1)
    assert "holds other pairs: factors differ; name another directory" in str(error)


def test_a_colour_changes_no_bit_of_states_and_of_noisy_readings_though_the_expert_acts_in_both(tmp_path: Path) -> None:
    [pair] = called("--factor", "objects.cube.color=yellow", "--out", tmp_path / "run", sets=(NOISY,))["pairs"]
    assert (pair["diverges"], pair["differs"], pair["acts_apart"]) == (None, None, None)
    assert pair["steps"][0] == pair["steps"][1] > 0
    a, b = (open_trajectory(tmp_path / "run" / "episodes" / pair[key]) for key in ("same", "changed"))
    assert {"sensor_tool_position", "sensor_tool_valid"} <= set(a.states)
    assert all(a.states[name].tobytes() == b.states[name].tobytes() for name in a.states)
    error = a.states["sensor_tool_position"] - a.states["joint_pos"][:, : a.states["sensor_tool_position"].shape[1]]
    assert np.abs(error).max() > 0.01, "it is noisy"


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_pairs_side_by_side_are_those_alone_on_every_engine(engine: str, tmp_path: Path) -> None:
    require_engine(engine)
    words = ("--factor", "objects.cube.mass=0.9", "-k", "3", "--actions", "same")
    told = [
        called(*words, "--at-once", at_once, "--out", tmp_path / at_once, sets=(NOISY,), engine=engine)
        for at_once in ("1", "2")
    ]
    assert [len(one["pairs"]) for one in told] == [3, 3]
    for alone, beside in zip(*(one["pairs"] for one in told), strict=True):
        names = ("same", "changed")
        assert {k: v for k, v in alone.items() if k not in names} == {k: v for k, v in beside.items() if k not in names}
        assert alone["diverges"] > 0
        for key in names:
            a, b = (open_trajectory(tmp_path / n / "episodes" / pair[key]) for n, pair in (("1", alone), ("2", beside)))
            assert set(a.states) == set(b.states)
            assert all(a.states[name].tobytes() == b.states[name].tobytes() for name in a.states)
            assert a.actions.tobytes() == b.actions.tobytes()
    assert [pair["same"] for pair in told[1]["pairs"]] == [
        "env_0000_episode_0000",
        "env_0002_episode_0000",
        "env_0000_episode_0001",
    ]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_noise_of_sensors_carries_over_to_the_bit_on_other_engines(engine: str, tmp_path: Path) -> None:
    require_engine(engine)
    words = ("--factor", "objects.cube.color=yellow", "--out", tmp_path / "run")
    [pair] = called(*words, sets=(NOISY,), engine=engine)["pairs"]
    assert (pair["diverges"], pair["differs"], pair["acts_apart"]) == (None, None, None)
    a, b = (open_trajectory(tmp_path / "run" / "episodes" / pair[key]) for key in ("same", "changed"))
    assert all(a.states[name].tobytes() == b.states[name].tobytes() for name in a.states)
    assert np.ptp(a.states["sensor_tool_position"] - a.states["joint_pos"][:, :9]) > 0.01


def test_the_picture_marks_the_diverging_step() -> None:
    gap = np.array([0.0, 1e-9, 1e-7, 1e-4, 0.5])
    picture = ElementTree.fromstring(divergence_picture("a < b", [Gap(0, gap, 3), Gap(1, 0 * gap, None)], 1e-6))
    lines = [one for one in picture.iter() if one.tag.endswith("polyline")]
    [mark] = [one for one in picture.iter() if one.tag.endswith("circle")]
    points = [tuple(map(float, point.split(","))) for point in lines[0].get("points", "").split()]
    assert (float(mark.get("cx", "")), float(mark.get("cy", ""))) == points[3]
    heights = [height for _, height in points]
    assert heights == sorted(heights, reverse=True)
    assert len({point.split(",")[1] for point in lines[1].get("points", "").split()}) == 1
    words = [one.text for one in picture.iter() if one.tag.endswith("text")]
    assert {"a < b", "0: step 3", "1: never"} <= set(words)


def test_an_unknown_path_lists_what_there_is(tmp_path: Path) -> None:
    error = called("--factor", "objects.cube.frction=0.2", "--out", tmp_path / "run", code=1)
    assert "did you mean 'objects.cube.friction'? What can: robots." in str(error)
    assert not (tmp_path / "run").exists()


def test_factors_are_paths_and_values() -> None:
    assert parse_factors(["a.b=1e-3", "c=[1, 2]", "d = red"]) == {"a.b": 0.001, "c": [1, 2], "d": "red"}
    for texts, said in (
        (["a.b"], "PATH=VALUE expected"),
        (["a=1", "a=2"], "a is given twice"),
        (["a=[1"], "the value is no YAML"),
    ):
        with pytest.raises(TaskError, match=said):
            parse_factors(texts)


def test_a_factor_that_nothing_depends_on_is_told_with_the_rule_of_pairs(capsys: pytest.CaptureFixture[str]) -> None:
    pair = {"episode": 0, "status": ["success"] * 2, "steps": [9, 9], "largest": {"body_pose": 0.0}}
    pair |= {"diverges": None, "differs": None, "acts_apart": None}
    told = {"pairs": [pair], "incomplete": [], "tolerance": 1e-6, "factors": {"objects.cube.friction": 0.2}}
    say_pairs(Path("out"), told, json=False)
    assert "not one bit differs" in (said := capsys.readouterr().err)
    assert "the larger friction counts" in said
    say_pairs(Path("out"), told | {"pairs": [pair | {"differs": 3}]}, json=False)
    assert "not one bit" not in capsys.readouterr().err

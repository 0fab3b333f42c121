"""Scripts: faults with their lines, moves in control steps, and the command line."""

from pathlib import Path

import numpy as np
import pytest
from typer import Typer
from typer.testing import CliRunner

from anysim.errors import AnysimError, PluginError, SpecError
from anysim_teleop.cli import teleop
from anysim_teleop.device import Button, DeviceInput, Job, Moment
from anysim_teleop.devices import make_device
from anysim_teleop.script import ScriptDevice

JOB = Job("task", "", "null", ("arm.tool",), 0.02, 0.2, 1.0)
NOW = Moment(0, 1, False, 0.0)


def script(tmp_path: Path, text: str) -> ScriptDevice:
    path = tmp_path / "script.yaml"
    path.write_text(text)
    return ScriptDevice(file=str(path))


def test_moves_last_as_long_as_they_say_and_the_end_ends_the_episode(tmp_path: Path) -> None:
    text = """
moves:
  - {for: 0.04, linear: [0.1, 0, 0]}
  - {gripper: close}
  - {for: 0.02, angular: [0, 0, 1], frame: tool, press: switch}
"""
    device = script(tmp_path, text)
    device.open(JOB)
    for _ in range(2):
        read = [device.read(NOW) for _ in range(4)]
        assert [r.twist.tolist() for r in read[:2]] == [[0.1, 0, 0, 0, 0, 0]] * 2
        assert read[2].closed is True
        assert read[2].frame == "tool"
        assert read[2].buttons == (Button.SWITCH,)
        assert read[2].twist[5] == 1
        assert read[3] == DeviceInput(read[3].twist, buttons=(Button.RECORD,))
        assert not read[3].twist.any()
        device.begin()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("moves: [{for: 1, liner: [1, 0, 0]}]", "script.yaml:1:18.*liner"),
        ("moves: [{for: 1, linear: [.nan, 0, 0]}]", "script.yaml:1:"),
        ("moves: [{press: reset}]", "record"),
        ("moves: []", "at least 1"),
        ("moves: [{for: -1}]", "script.yaml:1:"),
    ],
)
def test_a_fault_is_told_with_its_place(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=words):
        script(tmp_path, text)


def test_a_move_that_is_too_fast_names_the_option(tmp_path: Path) -> None:
    device = script(tmp_path, "moves: [{for: 1, linear: [0.3, 0, 0]}, {for: 1, angular: [0, 2, 0]}]")
    with pytest.raises(SpecError, match=r"--speed 0\.3") as caught:
        device.open(JOB)
    assert "--turn 2" in str(caught.value)
    assert "script.yaml:1:" in str(caught.value)


def test_options_are_checked_by_name_and_value(tmp_path: Path) -> None:
    with pytest.raises(AnysimError, match=r"'fil=x' is none of its options.*file"):
        make_device("script", ["fil=x"])
    with pytest.raises(AnysimError, match="option file"):
        make_device("script")
    with pytest.raises(PluginError, match="no device named 'scrypt' is installed"):
        make_device("scrypt")
    path = tmp_path / "7.yaml"
    path.write_text("moves: [{for: 1}]")
    assert np.all(make_device("script", [f"file={path}"]).read is not None)


def test_the_command_line_plays_a_script_and_says_how_it_went(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("up.yaml").write_text("moves: [{for: 0.1, linear: [0, 0, 0.1]}]")
    app = Typer()
    app.command()(teleop)
    options = "pick_cube -d script -D file=up.yaml --out run -o record.cameras=[] --min-success 1 --time 1"
    done = CliRunner().invoke(app, options.split())
    assert done.exit_code == 1, done.output
    assert "episode 0: truncated in 5 steps, not kept" in done.output
    assert "0 of 1 episodes succeeded; 0 trajectories" in done.output

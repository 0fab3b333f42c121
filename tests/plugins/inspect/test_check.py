"""Every broken file in `broken/` gives exactly the message beside it. ANYSIM_UPDATE_GOLDENS=1 writes them anew."""

import os
import sysconfig
from pathlib import Path

import pytest
from typer.testing import CliRunner

from anysim import registry
from anysim.cli.main import app
from anysim.errors import listing
from anysim_inspect.cli.check import report_on

pytestmark = pytest.mark.usefixtures("command_line")
BROKEN = Path(__file__).parent / "broken"
FILES = sorted(BROKEN.glob("*.yaml"))


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_a_broken_file_gives_its_golden_message(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(BROKEN)
    faults = report_on(path.name, engine=None, all_engines=False, overrides=[]).faults
    text = "".join(f"{fault}\n" for fault in faults)
    for place, word in (
        (sysconfig.get_paths()["purelib"], "<site-packages>"),
        (str(BROKEN), "<here>"),
        (str(BROKEN.parents[3]), "<root>"),
    ):
        text = text.replace(place, word)
    text = text.replace(", ".join(registry.names("engines")), "<engines>")  # which are installed differs
    text = text.replace(listing(registry.names("robots")), "<robots>")
    golden = path.with_suffix(".expected.txt")
    if os.environ.get("ANYSIM_UPDATE_GOLDENS"):
        golden.write_text(text)
    assert text == golden.read_text()
    assert text, "the file is not broken"


def test_there_are_enough_of_them() -> None:
    assert len(FILES) >= 12


def test_the_installed_task_has_no_faults() -> None:
    assert report_on("pick_cube", engine="mujoco", all_engines=False, overrides=[]).faults == []


def test_a_world_that_an_engine_cannot_run_is_refused_before_it_is_built() -> None:
    faults = report_on("pick_cube", engine="null", all_engines=False, overrides=[]).faults
    assert len(faults) == 1
    assert "null cannot run pick_cube: camera 'front' gives rgb (render: rgb)" in faults[0]


def test_an_engine_that_cannot_is_no_fault_where_another_can() -> None:
    report = report_on("pick_cube", None, all_engines=True, overrides=[])
    assert report.faults == []
    able = {answer.engine: not answer.refusal for answer in report.answers}
    assert able["mujoco"]
    assert not able["null"]
    said = CliRunner().invoke(app, ["check", "pick_cube", "--all-engines"])
    assert said.exit_code == 0
    able_names = ", ".join(name for name, runs in able.items() if runs)
    assert f"pick_cube: ok; runs on {able_names}; not on null" in said.stdout
    assert "camera 'front' gives rgb" in said.stderr


def test_a_world_that_no_engine_can_run_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "names", lambda kind: ["null"])
    said = CliRunner().invoke(app, ["check", "pick_cube", "--all-engines"])
    assert said.exit_code == 1
    assert "pick_cube: 1 fault; runs on no engine; not on null" in said.stdout


def test_what_is_approximate_is_one_line_with_its_count_and_every_line_on_request() -> None:
    short = CliRunner().invoke(app, ["check", "pick_cube", "-e", "mujoco"]).stdout.splitlines()
    long = CliRunner().invoke(app, ["check", "pick_cube", "-e", "mujoco", "-v"]).stdout.splitlines()
    measured = [line for line in long if line.startswith("mujoco: approximate: ")]
    assert short[-1] == long[-1] == "pick_cube: ok"
    assert len(short) == 3
    imported = [line for line in long if line.startswith("imported: panda: ")]
    assert short[1].startswith(f"imported: {len(imported)} notes of what sources say and the world does not (panda); `")
    assert short[0].startswith(f"approximate on mujoco: {len(measured)} (")
    assert "`anysim check pick_cube -e mujoco -v`" in short[0]
    assert any("a stiff soft constraint" in line for line in measured)


def test_the_first_screen_of_a_run_has_one_line_on_what_is_approximate(tmp_path: Path) -> None:
    def first_screen(*more: str) -> list[str]:
        blind = [f"world.cameras.{name}.channels=[]" for name in ("front", "wrist")]
        overrides = [word for one in ["record.cameras=[]", *blind] for word in ("-o", one)]
        words = ["run", "pick_cube", "-e", "mujoco", "--out", str(tmp_path), *overrides, *more]
        said = CliRunner().invoke(app, words)
        assert said.exit_code == 0, said.output
        return said.stdout.partition("trajectories: ")[0].splitlines()

    assert len(first_screen()) == 2
    assert sum("approximate: " in line for line in first_screen("-v")) >= 2


def test_success_that_is_worth_less_than_going_on_is_warned_of() -> None:
    poor = report_on("pick_cube", None, False, ["task.success.at_goal.reward=10"])
    assert not poor.faults
    warning = next(w for w in poor.warnings if "task.success" in w)
    assert "success is worth 10 and ends rewards of up to 400 in the 100 steps" in warning
    assert "`reward: 390` or more" in warning
    endless = report_on("pick_cube", None, False, ["task.success.at_goal.reward=10", "task.on_success=continue"])
    assert not any("task.success" in w for w in (*endless.warnings, *report_on("pick_cube", None, False, []).warnings))


def test_the_alternates_of_a_file_are_checked_and_not_those_of_what_it_extends(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("extends: task:pick_cube\nworld: {contact_sensors: {left: {body: panda.panda_leftfinger}}}\n")
    assert report_on(str(path), None, False, []).faults == []
    path.write_text(path.read_text() + "alternates: {ur5_gripper: {}}\n")
    (fault,) = report_on(str(path), None, False, []).faults
    assert "'panda' has no link or tool 'panda_leftfinger'" in fault

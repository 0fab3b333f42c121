"""Reports of tasks that cannot be done: which type each episode failed with, and what was tried before."""

from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from anysim_collect.cli.run import run
from anysim_collect.report import read_report
from tests.plugins.skills.test_honest_failures import CASES
from tests.plugins.skills.test_manipulation import WORLDS
from tests.tiers import often

app = typer.Typer()
app.command("run")(run)


@pytest.mark.parametrize("case", often(["a handle out of reach"], CASES))
def test_a_report_counts_failures_by_type_and_rungs_of_the_ladder(case: str, tmp_path: Path) -> None:
    world, overrides, outcome = CASES[case]
    changed = [word for override in overrides for word in ("-o", override)]
    words = [str(WORLDS / f"{world}.yaml"), "--engine", "mujoco", "--num-envs", "2", "--episodes", "3", "--seed", "11"]
    done = CliRunner().invoke(app, [*words, *changed, "--out", str(tmp_path / "run"), "--json"])
    assert done.exit_code == 0, done.output
    told = read_report(tmp_path / "run")
    assert (told["attempts"], told["successes"], told["kept"]) == (3, 0, 0)
    assert told["failures"] == {outcome: 3}
    assert told["ladder"].pop(f"{outcome} -> give up") == 3
    assert told["ladder"], "nothing else was tried"
    assert all(rung.startswith(f"{outcome} -> ") and count >= 3 for rung, count in told["ladder"].items())
    (command,) = told["commands"]
    assert (command["begun"], command["succeeded"], command["failures"]) == (3, 0, {outcome: 3})

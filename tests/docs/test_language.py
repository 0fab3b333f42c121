"""The commands of the page on language."""

import json
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from anysim.cli import main

PAGE = Path(__file__).parents[2] / "docs" / "language.md"
SAID = [line.strip() for line in PAGE.read_text().splitlines() if line.startswith("    anysim ")]
OF_TASKS = [line for line in SAID if "runs/" not in line]
OF_RUNS = [line for line in SAID if "runs/" in line]


@pytest.fixture(autouse=True)
def _all_commands() -> None:
    main._join_commands()


@pytest.mark.parametrize("line", OF_TASKS)
def test_a_command_about_a_task_says_it(line: str) -> None:
    result = CliRunner().invoke(main.app, shlex.split(line)[1:])
    assert result.exit_code == 0, result.exception
    assert "cube" in result.stdout


@pytest.mark.slow
def test_the_commands_about_a_run_say_what_happened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run = ["run", "stack_cube", "-k", "1", "-s", "1", "-o", "record.cameras=[]", "--out", "runs/stack_cube"]
    assert CliRunner().invoke(main.app, run).exit_code == 0
    for line in OF_RUNS:
        result = CliRunner().invoke(main.app, shlex.split(line)[1:])
        assert result.exit_code == 0, result.exception
        if "vqa" in line:
            assert (tmp_path / "vqa" / "stack_cube" / "questions.jsonl").read_text().count("\n") >= 40
        if "--json" in line and "describe" in line:
            (said,) = json.loads(result.stdout)
            kinds = [sentence["kind"] for sentence in said["narration"]]
            assert [k for k in kinds if k in ("lifted", "placed", "success")] == ["lifted", "placed", "success"]

"""Recordings that several tests ask about."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from anysim.cli import main


def record(task: str, out: Path) -> Path:
    """One trajectory of a task, without cameras."""
    main._join_commands()
    words = ["run", task, "-k", "1", "-s", "1", "-o", "record.cameras=[]", "--out", str(out)]
    done = CliRunner().invoke(main.app, words)
    assert done.exit_code == 0, done.output
    return next((out / "episodes").iterdir())


@pytest.fixture(scope="session")
def stacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A trajectory in which a cube is put on another one."""
    return record("stack_cube", tmp_path_factory.mktemp("runs") / "stack")

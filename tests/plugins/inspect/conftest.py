"""A run that the tests of this package look at."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.plugins.inspect.commands import app


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of two trajectories; not to be changed."""
    out = tmp_path_factory.mktemp("run")
    blind = [word for name in ("front", "wrist") for word in ("-o", f"world.cameras.{name}.channels=[]")]
    words = ["run", "pick_cube", "-e", "mujoco", "-n", "2", "-k", "2", "--out", str(out), "-o", "record.cameras=[]"]
    done = CliRunner().invoke(app, [*words, *blind])
    assert done.exit_code == 0, done.output
    return out

"""The application as users have it: with the commands of plugins."""

import pytest

from anysim import hooks
from anysim.cli.main import app


@pytest.fixture(scope="session", autouse=True)
def _joined() -> None:
    if not any(command.name == "run" for command in app.registered_commands):
        hooks.add_commands(app)

"""The command line of every test here has the commands of plugins."""

import pytest


@pytest.fixture(scope="session", autouse=True)
def _joined(command_line: object) -> None:
    pass

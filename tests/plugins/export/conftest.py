"""A run for all tests of exports."""

from pathlib import Path

import pytest

from tests.plugins.export.runs import record


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three episodes, two cameras; not to be written to."""
    return record(tmp_path_factory.mktemp("recorded") / "run")

"""The tests in a folder are of the backend of its name; where that is not installed they are skipped, and say so."""

import importlib.util
from pathlib import Path

import pytest

LIBRARIES = {"mechanics": "numba"}
"""What a backend is built on, where that has another name."""


class Absent(pytest.Module):
    """A module of tests that cannot even be imported here."""

    def collect(self):
        name = self.path.parent.name
        pytest.skip(f"the backend {name} is not installed", allow_module_level=True)


def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> pytest.Module | None:
    """Collect a module in the ordinary way unless its backend is missing."""
    name = module_path.parent.name
    if all(importlib.util.find_spec(needed) for needed in (LIBRARIES.get(name, name), f"anysim_{name}")):
        return None
    return Absent.from_parent(parent, path=module_path)

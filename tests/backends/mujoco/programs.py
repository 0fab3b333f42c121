"""Programs of `benchmarks/`, which is no package, and gymnasium's files, which they compare."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[3]


def program(name: str) -> ModuleType:
    """`benchmarks/NAME.py` as a module."""
    spec = importlib.util.spec_from_file_location(f"benchmark_{name}", ROOT / f"benchmarks/{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def gymnasium_files() -> Path:
    """The folder of gymnasium's MJCF files."""
    found = importlib.util.find_spec("gymnasium")
    if found is None or found.origin is None:
        pytest.skip("gymnasium, whose files these are, is not installed")
    return Path(found.origin).parent / "envs/mujoco/assets"

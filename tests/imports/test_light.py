"""Importing is free: what a bare import loads, and what works on a machine without any engine."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

ENGINES = ("mujoco", "pybullet", "sapien", "torch")
HEAVY = (
    *ENGINES, "numpy", "scipy", "pandas", "gymnasium", "pydantic", "yaml", "pluggy", "typer", "rich", "trimesh",
    "yourdfpy", "numba", "av", "matplotlib", "PIL",
)  # fmt: skip


def run(code: str, *arguments: str) -> str:
    """Run a program in a new interpreter, with warnings as errors, and return what it printed."""
    command = [sys.executable, "-I", "-W", "error", "-c", code, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def loaded_by(module: str, watched: tuple[str, ...]) -> list[str]:
    """Which of the watched packages importing a module loads."""
    code = "import importlib, sys; importlib.import_module(sys.argv[1]); print(*set(sys.argv[2:]) & set(sys.modules))"
    return sorted(run(code, module, *watched).split())


PACKAGES = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["root_packages"]


@pytest.mark.parametrize("package", PACKAGES)
def test_a_bare_import_loads_nothing_heavy(package: str) -> None:
    assert loaded_by(package, HEAVY) == []


@pytest.mark.parametrize("package", PACKAGES)
def test_a_bare_import_has_no_side_effects(package: str) -> None:
    code = """
import importlib, os, sys, threading
environment, paths, threads = dict(os.environ), list(sys.path), threading.active_count()
importlib.import_module(sys.argv[1])
assert dict(os.environ) == environment, "the environment changed"
assert sys.path == paths, "sys.path changed"
assert threading.active_count() == threads, "a thread was started"
"""
    assert run(code, package) == ""


def test_the_registry_lists_plugins_without_importing_them() -> None:
    code = """
import sys
from anysim import registry
for kind in registry.KINDS:
    print(kind, *registry.names(kind))
own = {name.partition(".")[0] for name in sys.modules if name.startswith("anysim_")} - {"anysim_schemas"}
assert not own, own
assert "mujoco" not in sys.modules
"""
    assert "engines" in run(code)


def test_every_module_of_the_core_imports_without_engines_and_viewers() -> None:
    """Modules are free to use heavy libraries inside functions; importing one needs none of them.

    The command line needs typer and rich and nothing else of what is blocked here; the contract suite needs pytest.
    """
    code = """
import importlib, pkgutil, sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in sys.argv[1:]:
            raise ModuleNotFoundError(f"{name} is blocked", name=name)

sys.meta_path.insert(0, Blocked())
import anysim, anysim_schemas
count = 0
for package in (anysim_schemas, anysim):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
            count += 1
print(count)
"""
    blocked = (
        *ENGINES,
        "pandas",
        "trimesh",
        "yourdfpy",
        "numba",
        "av",
        "matplotlib",
        "anysim_mujoco",
        "anysim_control.batch",
    )
    assert int(run(code, *blocked)) > 40


def test_unknown_names_of_the_package_are_attribute_errors() -> None:
    code = """
import anysim
try:
    anysim.does_not_exist
except AttributeError as error:
    print(error)
"""
    assert "does_not_exist" in run(code)


def test_every_lazy_name_is_listed() -> None:
    code = "import anysim; assert set(anysim.__all__) == set(dir(anysim)); print(*anysim.__all__)"
    assert "make" in run(code).split()

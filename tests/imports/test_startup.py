"""Start-up: what a command and a first step load, and how often installed distributions are searched."""

import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from anysim import hooks, registry
from anysim.cli.main import app

AT_EXIT = """
import atexit, sys
atexit.register(lambda: print("LOADED", *{name.partition(".")[0] for name in sys.modules}, *sys.modules))
"""
COMMAND = AT_EXIT + "sys.argv = ['anysim', *sys.argv[1:]]\nfrom anysim.cli.main import main\nmain()\n"
STEP = (
    AT_EXIT
    + """
import numpy as np
import anysim
env = anysim.make("pick_cube", engine="mujoco", overrides=["record.cameras=[]"])
env.reset(seed=0)
env.step(np.zeros((1, env.action_dim)))
env.close()
"""
)
NEVER = frozenset(
    {"pandas", "pybullet", "sapien", "torch", "matplotlib", "cv2", "onnxruntime", "pinocchio", "yourdfpy"}
)
"""Packages that neither a command nor a step on MuJoCo needs."""


def loaded(code: str, *arguments: str) -> set[str]:
    """The modules of a new interpreter at its end, and the packages they are in."""
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.rpartition("LOADED ")[2].split())


@pytest.mark.parametrize("words", [["--help"], ["run", "--help"], ["compare", "--help"], ["robot", "import", "--help"]])
def test_help_loads_no_more_than_typer_and_the_commands(words: list[str]) -> None:
    found = loaded(COMMAND, *words)
    unwanted = {"numpy", "scipy", "yaml", "mujoco", "gymnasium", "trimesh", "numba", "lxml", "PIL", "rich"}
    if len(words) == 1:
        unwanted |= {"pydantic"}  # typer reads the options of a command with it, and needs none for the list of them
    assert not sorted(found & (NEVER | unwanted))
    plugins = {name for name in found if name.startswith("anysim_") and "." in name}
    assert plugins, "the plugins' commands are there"
    assert {name.split(".")[1] for name in plugins} <= {
        "commands",
        "cli",
        "errors",
        "mixture",  # of an option's choices
        "options",  # that several commands have
    }


def test_a_version_searches_nothing() -> None:
    found = {name for name in loaded(COMMAND, "--version") if name.startswith("anysim_") and "." in name}
    assert found <= {"anysim_schemas.errors"}


def test_a_step_loads_only_what_it_uses() -> None:
    loaded(STEP)  # the first prepares the robot's files in the cache
    found = loaded(STEP)
    assert "mujoco" in found
    unwanted = {"numba", "scipy", "trimesh", "gymnasium", "typer", "rich", "av", "PIL", "OpenGL"}
    assert not sorted(found & (NEVER | unwanted))


def test_distributions_are_searched_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[object] = []
    search = metadata.entry_points

    def counted(**wanted: str) -> object:
        calls.append(wanted)
        return search(**wanted)

    monkeypatch.setattr(metadata, "entry_points", counted)
    registry.refresh()
    for kind in registry.KINDS:
        registry.names(kind)
    assert registry.observers()
    assert {"anysim", "anysim-mujoco", "anysim-tasks"} <= set(registry.participants())
    assert len(calls) == 1


def test_commands_of_every_observer_join(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hook that raises costs its own commands, in one sentence; those of the others are there."""

    class Faulty:
        @hooks.hookimpl
        def add_cli(self) -> None:
            raise OSError("no such display")

    plugin = Faulty()
    hooks.manager().register(plugin, "anysim-faulty:window")
    monkeypatch.setattr(app, "registered_commands", list(app.registered_commands))
    monkeypatch.setattr(app, "registered_groups", list(app.registered_groups))
    try:
        with pytest.warns(RuntimeWarning) as told:
            hooks.add_commands(app)
    finally:
        hooks.manager().unregister(plugin)
    assert [str(one.message) for one in told] == [
        "the plugin 'window' of anysim-faulty adds no commands: OSError: no such display; "
        + registry.remedy("anysim-faulty")
    ]
    assert {"compare", "picture", "gallery"} <= {command.name for command in app.registered_commands}


@pytest.mark.slow
def test_the_program_that_measures_starts_measures_both() -> None:
    program = Path(__file__).parents[2] / "benchmarks" / "startup.py"
    command = [sys.executable, str(program), "--rounds", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode in (0, 1), done.stderr  # 1: a limit is missed, beside other work
    head, *rows = done.stdout.splitlines()
    assert head.split() == ["cpu", "s", "wall", "s", "limit", "s"]
    assert [row.split("  ")[0] for row in rows] == ["anysim --help", "anysim run pick_cube, first step"]
    assert (done.returncode == 1) == ("missed" in done.stdout)
    done = subprocess.run([*command, "--task", "no_task"], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 1
    assert "no task named 'no_task'" in done.stderr

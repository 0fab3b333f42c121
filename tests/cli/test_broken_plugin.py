"""The command line beside an installed plugin that does not load."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests import forked

BROKEN = Path(__file__).parents[1] / "external" / "anysim-broken"
SENTENCE = (
    "warning: the plugin 'commands' of anysim-broken does not load: ModuleNotFoundError: No module named "
    "'warp_drive_gauges'; repair the package anysim-broken (pip install --upgrade anysim-broken), or remove it: "
    "pip uninstall anysim-broken\n"
)


@pytest.fixture
def installed(tmp_path: Path) -> dict[str, str]:
    """The environment of a process that finds tests/external/anysim-broken installed."""
    project = tomllib.loads((BROKEN / "pyproject.toml").read_text())["project"]
    info = tmp_path / f"anysim_broken-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    groups = [
        "\n".join([f"[{group}]", *(f"{name} = {value}" for name, value in entries.items())])
        for group, entries in project["entry-points"].items()
    ]
    (info / "entry_points.txt").write_text("\n".join(groups))
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(BROKEN)])}


def anysim(environment: dict[str, str], *words: str) -> subprocess.CompletedProcess[str]:
    return forked.run("-m", "anysim.cli", *words, env=environment)


@pytest.mark.parametrize("words", [["--help"], ["compare", "--help"], ["list", "writers"]])
def test_commands_work_and_one_sentence_names_the_plugin(installed: dict[str, str], words: list[str]) -> None:
    healthy = anysim(dict(os.environ), *words)
    result = anysim(installed, *words)
    assert (result.returncode, result.stdout) == (0, healthy.stdout)
    assert result.stderr == SENTENCE
    assert healthy.stderr == ""


def test_what_machines_read_is_free_of_it(installed: dict[str, str]) -> None:
    result = anysim(installed, "list", "writers", "--json")
    assert result.stdout.startswith("[")
    assert result.stderr == SENTENCE


def test_a_version_is_printed_without_looking_at_plugins(installed: dict[str, str]) -> None:
    result = anysim(installed, "--version")
    assert (result.returncode, result.stderr) == (0, "")


def test_python_warns_and_goes_on(installed: dict[str, str]) -> None:
    code = "from anysim import hooks; print(len(hooks.manager().get_plugins()) > 0)"
    command = [sys.executable, "-c", code]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300, env=installed, check=False)
    assert result.stdout == "True\n"
    assert "RuntimeWarning: the plugin 'commands' of anysim-broken does not load" in result.stderr

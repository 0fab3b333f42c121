"""Engines are examined in processes of their own: whatever one does costs its own findings alone."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from anysim import registry
from anysim.engine.availability import Health
from anysim_inspect.engines import Examination, examine

BASE = """
import os, sys, time
from anysim.testing.kinematic import NullEngine
from anysim.engine.capability import Capabilities, Capability, Support
from anysim.engine.state import Availability

class Engine(NullEngine):
    name = "odd"
"""
Install = Callable[[str], None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Installs a distribution with one engine `odd`, whose class body ends in the given lines."""

    def make(body: str) -> None:
        info = tmp_path / "odd_engine-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: odd-engine\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text("[anysim.engines]\nodd = odd_engine_module:Engine\n")
        (tmp_path / "odd_engine_module.py").write_text(BASE + body)
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        registry.refresh()

    yield make
    monkeypatch.undo()
    sys.modules.pop("odd_engine_module", None)
    registry.refresh()


def by_name(examination: Examination) -> dict[str, tuple[Health, str, str]]:
    """Findings by what they are about."""
    return {what: (state, found, remedy) for what, state, found, remedy in examination.findings}


def test_an_engine_that_works_says_what_it_is_and_where_it_comes_from() -> None:
    examination = examine("mujoco")
    found = by_name(examination)
    assert examination.works
    assert found["engine: mujoco"][0] is Health.OK
    assert found["engine: mujoco"][1].endswith("of anysim-mujoco")
    assert found["mujoco: physics"][0] is Health.OK
    assert "4.0.0" in found["mujoco: versions"][1]
    assert found["mujoco: rendering"][0] in (Health.OK, Health.BROKEN)  # as the machine's OpenGL is


def test_an_engine_that_does_not_import_names_itself_and_its_package(install: Install) -> None:
    install("    import a_module_that_is_not_there\n")
    examination = examine("odd")
    state, found, remedy = by_name(examination)["engine: odd"]
    assert not examination.works
    assert state is Health.BROKEN
    assert "'odd' of odd-engine" in found
    assert "a_module_that_is_not_there" in found
    assert remedy == registry.remedy("odd-engine")
    assert "pip uninstall odd-engine" in remedy
    assert examine("null").findings[0].state is Health.OK


def test_a_version_that_must_not_be_used_comes_with_its_remedy(install: Install) -> None:
    install(
        "    @classmethod\n    def availability(cls):\n"
        "        return Availability(False, '4', ('odd 4 is unusable: it computes odd numbers',), 'install odd 3')\n"
    )
    assert by_name(examine("odd"))["engine: odd"] == (
        Health.UNAVAILABLE,
        "odd 4 is unusable: it computes odd numbers",
        "install odd 3",
    )


def test_an_engine_that_kills_its_process_is_found_dead(install: Install) -> None:
    install("    def _build(self, world, num_envs):\n        sys.stderr.write('last words'); os.abort()\n")
    state, found, _ = by_name(examine("odd"))["odd: physics"]
    assert state is Health.BROKEN
    assert "SIGABRT" in found
    assert "last words" in found


def test_a_crash_while_drawing_leaves_the_physics_that_was_found(install: Install) -> None:
    install(
        "    capabilities = Capabilities({**NullEngine.capabilities.supported, Capability.RENDER_RGB: Support()})\n"
        "    def _render(self, view, ids, channels):\n        os._exit(3)\n"
    )
    found = by_name(examine("odd"))
    assert found["odd: physics"][0] is Health.ABSENT
    assert found["odd: rendering"][0] is Health.BROKEN
    assert "ended with exit code 3" in found["odd: rendering"][1]


@pytest.mark.slow
def test_an_engine_that_hangs_is_given_up(install: Install) -> None:
    install("    def _build(self, world, num_envs):\n        time.sleep(600)\n")
    state, found, _ = by_name(examine("odd", timeout=6.0))["odd: physics"]
    assert state is Health.BROKEN
    assert "took longer than 6 s" in found


def test_an_engine_with_gravity_of_its_own_is_wrong(install: Install) -> None:
    install("    capabilities = Capabilities({**NullEngine.capabilities.supported, Capability.DYNAMICS: Support()})\n")
    examination = examine("odd")
    state, found, _ = by_name(examination)["odd: physics"]
    assert state is Health.WRONG
    assert "falls 0.0000 m" in found
    assert not examination.works

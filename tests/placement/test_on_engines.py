"""Layouts hold on the engines: nothing starts inside of anything, and everything stays where it was put."""

import runpy
from pathlib import Path

import pytest

from anysim.engine.factory import engine_class

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
@pytest.mark.parametrize("what", ["tabletops", "rooms"])
def test_layouts_stay(what: str, engine: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if not engine_class(engine).availability().available:
        pytest.skip(f"{engine} cannot run here")
    check = runpy.run_path(str(ROOT / "benchmarks" / "layouts.py"))["check"]
    assert check(engine, what, 20, 1.0, tmp_path), capsys.readouterr().out

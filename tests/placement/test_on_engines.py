"""Layouts hold on the engines: nothing starts inside of anything, and everything stays where it was put."""

import runpy
from pathlib import Path

import pytest

from anysim.testing.engines import require_engine

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
@pytest.mark.parametrize("what", ["tabletops", "rooms"])
def test_layouts_stay(what: str, engine: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    require_engine(engine)
    check = runpy.run_path(str(ROOT / "benchmarks" / "layouts.py"))["check"]
    assert check(engine, what, 20, 1.0, tmp_path), capsys.readouterr().out

"""The world with all fifteen families at once: random play in it, saved in the middle and replayed, on every engine."""

import runpy
from pathlib import Path
from typing import Any

import pytest

import anysim
from anysim.record.replay import replay
from anysim.testing.engines import require_drawing

ROOT = Path(__file__).parents[2]
ENGINES = ("mujoco", "pybullet", "sapien")
EACH = [pytest.param(one, marks=pytest.mark.slow if one == "mujoco" else pytest.mark.full) for one in ENGINES]


def benchmark() -> dict[str, Any]:
    """`benchmarks/fifteen_families.py`, which is no package."""
    return runpy.run_path(str(ROOT / "benchmarks" / "fifteen_families.py"))


def matrix() -> set[str]:
    """The fifteen, as the program that makes the matrix names them."""
    return set(runpy.run_path(str(ROOT / "benchmarks" / "families.py"))["NAMES"])


def test_all_fifteen_are_in_it() -> None:
    loaded = anysim.load(benchmark()["WORLD"])
    kinds = {family.kind for family in loaded.spec.world.families.values()}
    world = anysim.compile_world(loaded)
    held = {entity.family for entity in world.entities}
    assert kinds | held == matrix()
    assert len(kinds | held) == 15


@pytest.mark.parametrize("engine", EACH)
def test_play_goes_on_from_its_middle_and_replays(engine: str, tmp_path: Path) -> None:
    require_drawing(engine)
    found = benchmark()["play"](engine, 8, 2, tmp_path)
    assert found["identical"]
    assert found["episodes"] == ["truncated, 8 steps"] * 2
    episodes = sorted((tmp_path / engine / "episodes").iterdir())
    assert all((one / "front.mp4").stat().st_size for one in episodes)
    assert replay(episodes[1]).identical


@pytest.mark.slow
@pytest.mark.full
@pytest.mark.parametrize("engine", ENGINES)
def test_a_minute_of_it(engine: str, tmp_path: Path) -> None:
    require_drawing(engine)
    found = benchmark()["play"](engine, 3000, 2, tmp_path)
    assert found["identical"]
    assert found["episodes"] == ["truncated, 3000 steps"] * 2
    assert max(found["farthest"].values()) < 5.0

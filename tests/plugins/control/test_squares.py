"""Bases drive a square of 2 m blindly on every engine and come back to where they began."""

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]

SQUARES = runpy.run_path(str(ROOT / "benchmarks" / "bases.py"))


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
@pytest.mark.parametrize(
    ("robot", "kind"),
    [("differential_base", "differential"), ("ackermann_base", "ackermann"), ("holonomic_base", "swerve")],
)
def test_a_square_comes_back(robot: str, kind: str, engine: str) -> None:
    found = SQUARES["drive"](robot, engine, side=2.0)
    length, angle = SQUARES["BOUNDS"][kind]
    assert found.off_path <= length
    assert found.end <= length
    assert found.end_yaw <= angle
    assert found.behind <= 0.06, "the drives' lag, 0.03 s, and the car's longer way behind its steering"

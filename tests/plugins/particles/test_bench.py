"""`anysim bench families`: it knows every family of the matrix, and measures what is asked for."""

import runpy
from pathlib import Path

import pytest

import anysim
from anysim_particles.bench import EDGES, cost
from anysim_particles.bench_cases import FAMILIES, OBJECTS

ROOT = Path(__file__).parents[3]


def test_every_family_of_the_matrix_is_measured():
    names = runpy.run_path(str(ROOT / "benchmarks" / "families.py"))["NAMES"]
    assert sorted([*OBJECTS, *EDGES, *FAMILIES]) == sorted(names)


@pytest.mark.parametrize(("kind", "points"), [("rigid_instancer", 100), ("fire", 400)])
def test_a_family_is_measured_beside_the_world_without_it(kind, points, monkeypatch):
    monkeypatch.setattr("anysim_particles.bench.SETTLE", 1)
    found = cost(kind, 1, 2, "mujoco", 1)
    assert (found.family, found.particles, found.num_envs) == (kind, points, 2)
    assert found.alone > found.per_second > 0


def test_a_name_that_is_no_family_is_told():
    from anysim_particles.cli import families

    with pytest.raises(anysim.errors.AnysimError, match=r"--kinds.*watr.*fluid"):
        families(kinds="watr", num_envs="1")

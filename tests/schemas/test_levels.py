"""Levels of difficulty: changes to a file that a name chooses."""

from pathlib import Path

import pytest

from anysim_schemas.errors import SpecError
from anysim_schemas.load import load_run

FILE = """
physics: {dt: 0.002}
world: {name: a, objects: {cube: {source: {box: [0.1, 0.1, 0.1]}, mass: {range: [0.1, 0.2]}}}}
levels:
  easy: {physics: {dt: 0.001}, world: {objects: {cube: {mass: 0.1}}}}
  plain: {}
  wrong: {world: {objects: {cube: {masss: 0.1}}}}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.yaml"
    path.write_text(FILE)
    return path


def test_a_level_is_merged_beneath_overrides(file: Path) -> None:
    spec = load_run(file, overrides=["level=easy", "physics.dt=0.004"]).spec
    assert (spec.physics.dt, spec.world.objects["cube"].mass, spec.level) == (0.004, 0.1, "easy")
    plain = load_run(file, overrides=["level=plain"]).spec
    assert plain.world == load_run(file).spec.world


def test_what_a_level_has_made_is_the_same_if_it_is_read_again(file: Path) -> None:
    spec = load_run(file, overrides=["level=easy", "world.objects.cube.mass=0.3"]).spec
    assert load_run(spec.to_dict()).spec == spec
    assert set(spec.levels) == {"easy", "plain", "wrong"}


def test_a_file_extends_levels(file: Path) -> None:
    above = file.with_name("b.yaml")
    above.write_text("extends: a.yaml\nlevel: easy\nlevels: {easy: {world: {objects: {cube: {mass: 0.15}}}}}\n")
    spec = load_run(above).spec
    assert (spec.physics.dt, spec.world.objects["cube"].mass) == (0.001, 0.15)


@pytest.mark.parametrize(
    ("level", "said"),
    [
        ("eazy", "-o level=eazy: level: there is no level 'eazy'; did you mean 'easy'? (levels: easy, plain, wrong)"),
        ("wrong", "a.yaml:7:36: world.objects.cube.masss: unknown key; did you mean 'mass'?"),
    ],
)
def test_faults_are_told_where_they_stand(file: Path, level: str, said: str) -> None:
    with pytest.raises(SpecError) as told:
        load_run(file, overrides=[f"level={level}"])
    assert said in str(told.value)

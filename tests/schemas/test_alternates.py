"""Other robots for a task: what a file changes for each, chosen by the robot's name."""

from pathlib import Path

import pytest

from anysim_schemas.errors import SpecError
from anysim_schemas.load import load_run

FILE = """
world:
  name: a
  robots: {arm: {robot: panda, position: [0.0, 0.0, 0.4], home: {panda_joint2: -0.7}, home_noise: 0.02}}
  objects: {cube: {source: {box: [0.1, 0.1, 0.1]}, mass: 0.2}}
levels:
  L0: {world: {objects: {cube: {mass: 0.1, friction: 0.9}}}}
alternates:
  ur5: {world: {robots: {arm: {home: {elbow: 1.0}}}, objects: {cube: {mass: 0.3}}}}
  z1: {}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.yaml"
    path.write_text(FILE)
    return path


def test_an_alternate_stands_where_the_robot_stood_and_begins_as_it_does(file: Path) -> None:
    """What the file says of the old one's joints goes with it; what it says of the new one's is on top."""
    arm = load_run(file, overrides=["robot=z1"]).spec.world.robots["arm"]
    assert (arm.robot, arm.position, arm.home, arm.home_noise) == ("z1", (0.0, 0.0, 0.4), {}, 0.02)
    spec = load_run(file, overrides=["robot=ur5"]).spec
    assert (spec.world.robots["arm"].home, spec.world.objects["cube"].mass) == ({"elbow": 1.0}, 0.3)


def test_a_robot_that_the_file_does_not_list_is_one_as_well(file: Path) -> None:
    assert load_run(file, overrides=["robot=another"]).spec.world.robots["arm"].robot == "another"


def test_its_own_robot_changes_nothing(file: Path) -> None:
    assert load_run(file, overrides=["robot=panda"]).spec.world == load_run(file).spec.world


def test_an_alternate_is_on_top_of_a_level_and_beneath_overrides(file: Path) -> None:
    cube = load_run(file, overrides=["robot=ur5", "level=L0"]).spec.world.objects["cube"]
    assert (cube.mass, cube.friction) == (0.3, 0.9)
    given = ["world.objects.cube.mass=0.5", "robot=ur5"]
    assert load_run(file, overrides=given).spec.world.objects["cube"].mass == 0.5


def test_what_it_has_made_is_the_same_if_it_is_read_again(file: Path) -> None:
    spec = load_run(file, overrides=["robot=ur5", "world.objects.cube.mass=0.6"]).spec
    assert load_run(spec.to_dict()).spec == spec
    assert set(spec.alternates) == {"ur5", "z1"}


def test_of_several_robots_the_alternate_says_which(file: Path) -> None:
    two = file.with_name("b.yaml")
    two.write_text("extends: a.yaml\nworld: {robots: {other: {robot: panda}}}\n")
    with pytest.raises(SpecError, match="this one has arm, other; say which"):
        load_run(two, overrides=["robot=z1"])
    two.write_text(two.read_text() + "alternates: {z1: {world: {robots: {arm: {robot: z1}, other: {robot: z1}}}}}\n")
    spec = load_run(two, overrides=["robot=z1"]).spec
    assert [(one.robot, one.home) for one in spec.world.robots.values()] == [("z1", {}), ("z1", {})]
    assert load_run(spec.to_dict()).spec == spec


def test_faults_are_told_where_they_stand(file: Path) -> None:
    file.write_text(FILE.replace("z1: {}", "z1: {world: {objects: {cube: {masss: 0.1}}}}"))
    load_run(file)
    with pytest.raises(SpecError) as told:
        load_run(file, overrides=["robot=z1"])
    assert "a.yaml:10:33: world.objects.cube.masss: unknown key; did you mean 'mass'?" in str(told.value)

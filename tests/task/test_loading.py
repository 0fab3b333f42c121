"""Loading of files into worlds: relative assets, and merged files."""

from pathlib import Path

import pytest

import anysim
from anysim import api
from anysim.errors import AssetError, SpecError, TaskError

TETRAHEDRON = """solid t
facet normal 0 0 -1
outer loop
vertex 0 0 0
vertex 0 0.1 0
vertex 0.1 0 0
endloop
endfacet
facet normal 0 -1 0
outer loop
vertex 0 0 0
vertex 0.1 0 0
vertex 0 0 0.1
endloop
endfacet
facet normal -1 0 0
outer loop
vertex 0 0 0
vertex 0 0 0.1
vertex 0 0.1 0
endloop
endfacet
facet normal 1 1 1
outer loop
vertex 0.1 0 0
vertex 0 0.1 0
vertex 0 0 0.1
endloop
endfacet
endsolid t
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A base file with a mesh beside it, extended from another folder."""
    (tmp_path / "base" / "meshes").mkdir(parents=True)
    (tmp_path / "pyproject.toml").touch()  # one project: its files may extend each other
    (tmp_path / "base" / "meshes" / "t.stl").write_text(TETRAHEDRON)
    (tmp_path / "base" / "base.yaml").write_text("world:\n  objects:\n    t: {source: {mesh: meshes/t.stl}}\n")
    (tmp_path / "child").mkdir()
    (tmp_path / "child" / "child.yaml").write_text("extends: ../base/base.yaml\nworld: {name: child}\n")
    return tmp_path


def test_an_asset_is_relative_to_the_file_that_names_it(folder: Path) -> None:
    world = anysim.compile_world(folder / "child" / "child.yaml")
    assert world.name == "child"
    assert [entity.name for entity in world.entities] == ["t"]


def test_an_override_is_relative_to_the_last_file(folder: Path) -> None:
    with pytest.raises(AssetError, match=r"-o world\.objects\.t\.source.*meshes/other\.stl"):
        anysim.compile_world(folder / "child" / "child.yaml", overrides=["world.objects.t.source=meshes/other.stl"])


def test_several_files_are_merged_in_order(folder: Path) -> None:
    more = folder / "more.yaml"
    more.write_text("world:\n  objects:\n    t: {mass: 0.3}\n    b: {source: {sphere: 0.05}}\n")
    spec = anysim.load(folder / "child" / "child.yaml", more).spec
    assert list(spec.world.objects) == ["t", "b"]
    assert spec.world.objects["t"].mass == 0.3
    world = anysim.compile_world(anysim.load(folder / "child" / "child.yaml", more))
    assert len(world.entities) == 2


def test_a_task_that_is_extended_like_a_file_is_suggested(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("extends: pick_cube\n")
    with pytest.raises(
        SpecError, match=r"mine\.yaml:1:10: extends: there is no file .*; did you mean 'task:pick_cube'\?"
    ):
        anysim.load(file)
    file.write_text("extends: pick_cubes\n")
    with pytest.raises(SpecError, match="does not exist"):
        anysim.load(file)


def test_a_file_without_a_task_is_refused_before_its_world_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(api, "compile_world", lambda *_, **__: pytest.fail("the world was built"))
    with pytest.raises(TaskError, match="this file has no `task`"):
        anysim.make({"world": {}}, engine="null")


def test_a_file_without_a_task_is_named(tmp_path: Path) -> None:
    (tmp_path / "world.yaml").write_text("world: {name: w}\n")
    with pytest.raises(TaskError, match=r"world\.yaml: this file has no `task`"):
        anysim.make(tmp_path / "world.yaml", engine="null")


def test_another_robot_takes_the_place_of_the_only_one() -> None:
    with pytest.raises(SpecError, match="this one has robot, partner; say which"):
        anysim.make("bi_dex_lift", robot="ur5_gripper")
    with pytest.raises(SpecError, match=r"tabletop.yaml:\d+:\d+: .*'unitree_go1' has no channel 'arm'"):
        anysim.make("pick_cube", robot="unitree_go1")
    with pytest.raises(SpecError, match="did you mean 'ur5_gripper'"):
        anysim.make("pick_cube", robot="ur5_griper")
    with pytest.raises(TaskError, match="robot is the name of a robot of the catalogue, got 5"):
        anysim.make("pick_cube", robot=5)  # pyright: ignore[reportArgumentType]
    with pytest.raises(SpecError, match="no robot named 'null'"):
        anysim.make("pick_cube", robot="null")

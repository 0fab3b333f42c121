"""`anysim explain`: the draws of a world, with a task or without one."""

import json
from pathlib import Path

from typer.testing import CliRunner

from tests.plugins.inspect.commands import app

WORLD = """\
world:
  objects:
    cube:
      source: {mesh: meshes/cube.stl}
      mass: {range: [0.1, 0.3]}
  layout:
    cube: {on: terrain, x: {range: [0.3, 0.5]}}
"""


def test_a_world_without_a_task_is_explained_with_the_lines_of_its_own_file(tmp_path: Path) -> None:
    import trimesh

    (tmp_path / "meshes").mkdir()
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "meshes/cube.stl")
    file = tmp_path / "world.yaml"
    file.write_text(WORLD)
    said = CliRunner().invoke(app, ["explain", str(file), "--seed", "1", "--json"])
    assert said.exit_code == 0, said.exception
    where = {draw["path"]: draw["where"] for draw in json.loads(said.stdout)["draws"]}
    assert where["world.objects.cube.mass"] == f"{file}:5:13"
    assert where["world.layout.cube.x"] == f"{file}:7:28"


def test_a_world_in_which_nothing_is_random(tmp_path: Path) -> None:
    file = tmp_path / "world.yaml"
    file.write_text("world: {objects: {cube: {source: {box: [0.1, 0.1, 0.1]}}}}\n")
    said = CliRunner().invoke(app, ["explain", str(file)])
    assert said.exit_code == 0, said.exception
    assert "nothing in this file is random" in said.stdout

"""Whole USD files as worlds: trees as objects at their places, lights, cameras, gravity and the ground."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pxr", reason="USD files are read by usd-core, which the dependency group `test` has")

from anysim.api import compile_world
from anysim.conventions import WORLD
from anysim.engine.factory import create_simulation
from anysim.errors import SpecError
from anysim.model.world import BodyKind, World
from tests.plugins.usd.conftest import HEAD, body, joint, world

CUBE = 'def Cube "c" (prepend apiSchemas = ["PhysicsCollisionAPI"]) {\ndouble size = 0.2\n}\n'
ROOM = world(
    'def PhysicsScene "s" (prepend apiSchemas = ["PhysxSceneAPI"]) {'
    "\nvector3f physics:gravityDirection = (0, 0, -1)\nfloat physics:gravityMagnitude = 3.7"
    "\nuint physxScene:timeStepsPerSecond = 250\nbool physxScene:enableCCD = true\n}",
    'def Plane "floor" (prepend apiSchemas = ["PhysicsCollisionAPI"]) {\nuniform token axis = "Z"\n}',
    'def Cube "wall" (prepend apiSchemas = ["PhysicsCollisionAPI"]) {\ndouble3 xformOp:translate = (0, 5, 0.5)\n'
    'uniform token[] xformOpOrder = ["xformOp:translate"]\ndouble size = 1\n}',
    body("cup", CUBE, at="(1, 0, 0.1)"),
    body("case", CUBE, at="(0, 1, 0.1)"),
    body("door", CUBE, at="(0, 1, 0.4)"),
    joint("hinge", "Revolute", "case", "door", "point3f physics:localPos0 = (0, 0, 0.3)"),
    joint("fixed", "Fixed", "", "case", "point3f physics:localPos0 = (0, 1, 0.1)"),
    'def DistantLight "sun" {\nfloat inputs:intensity = 3000\n}',
    'def DomeLight "sky" {\n}',
    'def Camera "eye" {\ndouble3 xformOp:translate = (0, 0, 3)'
    '\nuniform token[] xformOpOrder = ["xformOp:translate"]\n}',
)


def write(folder: Path, text: str = ROOM, head: str = HEAD) -> str:
    path = folder / "room.usda"
    path.write_text(head + text.replace("}", "\n}"), encoding="utf-8")
    return str(path)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> World:
    source = write(tmp_path_factory.mktemp("room"))
    return compile_world({"world": {"source": source, "objects": {"cup": {"mass": 0.3}}}})


def test_trees_are_objects_at_their_places(room: World) -> None:
    assert [entity.name for entity in room.entities] == ["cup", "case", "surroundings"]
    assert [one.name for one in room.bodies] == ["cup", "case", "case.door", "surroundings"]
    assert [one.kind for one in room.bodies] == [BodyKind.FREE, BodyKind.STATIC, BodyKind.LINK, BodyKind.STATIC]
    assert np.allclose(room.initial_body_pose[:, :3], [(1, 0, 0.1), (0, 1, 0.1), (0, 1, 0.4), (0, 0, 0)], atol=1e-12)
    assert room.bodies[0].inertial.mass == 0.3
    assert sum(geom.body == WORLD for geom in room.geoms) == 1


def test_physics_lights_and_cameras_are_the_world_s(room: World) -> None:
    assert (room.physics.gravity, room.physics.dt, room.physics.control_dt) == ((0.0, 0.0, -3.7), 0.004, 0.02)
    assert room.lights[0].direction == (0.0, 0.0, -1.0)
    assert room.lights[0].intensity == 0.8
    assert room.cameras[0].position == (0.0, 0.0, 3.0)


def test_what_is_left_out_is_noted(room: World) -> None:
    notes = [text for _, text in room.notes]
    for words in ("prim DomeLight", "physxScene:enableCCD", "shine relative to each other"):
        assert any(words in note for note in [*notes, *(f"{a}: {b}" for a, b in room.notes)]), words


def test_y_up_and_centimetres_are_turned_and_scaled(tmp_path: Path) -> None:
    head = HEAD.replace('"Z"', '"Y"').replace("metersPerUnit = 1", "metersPerUnit = 0.01")
    text = world(
        body("cup", CUBE, at="(100, 20, 0)"),
        'def Plane "floor" (prepend apiSchemas = ["PhysicsCollisionAPI"]) {\nuniform token axis = "Y"\n}',
    )
    found = compile_world({"world": {"source": write(tmp_path, text, head)}})
    assert np.allclose(found.initial_body_pose[0], (1, 0, 0.2, 0, 0, 0, 1), atol=1e-12)
    assert found.physics.gravity == (0.0, 0.0, -9.81)
    assert [geom.name for geom in found.geoms if geom.body == WORLD] == ["terrain"]


def test_a_world_of_a_file_runs(room: World) -> None:
    engine = create_simulation("mujoco").create_world(room)
    try:
        engine.reset()
        engine.step(100)
        height = float(engine.get_state().body_pose[0, 0, 2])
    finally:
        engine.destroy()
    assert abs(height - 0.1) < 2e-3  # the cup stands on the ground


def test_a_file_that_leaves_its_folder_is_refused_where_it_is_named(tmp_path: Path) -> None:
    (tmp_path / "outside.usda").write_text(HEAD + ROOM)
    (tmp_path / "in").mkdir()
    source = write(tmp_path / "in", 'def "x" (references = @../outside.usda@) {\n}\n')
    with pytest.raises(SpecError, match="leaves the asset's root"):
        compile_world({"world": {"source": source}})

"""Whole SDF files as worlds: each tree an object at its place, whatever its pose is relative to."""

from math import cos, sin
from pathlib import Path

import numpy as np
import pytest

from anysim.api import compile_world, load, make, watched
from anysim.compile.world import compile_with_report
from anysim.conventions import WORLD
from anysim.errors import SpecError
from anysim.math import pose as P
from anysim.model.world import BodyKind, World
from anysim.testing.audit import audit
from tests.tiers import ENGINES

BALL = """<sdf version="1.9"><model name="sphere"><link name="it"><pose>0.1 0 0 0 0 0</pose>
  <inertial><mass>2</mass></inertial>
  <collision name="c"><geometry><sphere><radius>.1</radius></sphere></geometry></collision>
</link></model></sdf>"""

SCENE = """<sdf version="1.9">
<world name="room">
  <gravity>0 0 -9.0</gravity>
  <physics name="a" type="ode"><max_step_size>0.001</max_step_size><ode/></physics>
  <plugin name="p" filename="x"/>
  <light name="sun" type="directional"><pose>0 0 10 0 0 0</pose><diffuse>.8 .8 .4 1</diffuse>
    <direction>-.5 0 -.9</direction><cast_shadows>true</cast_shadows></light>
  <light name="lamp" type="point"><pose relative_to="corner">1 0 2 0 0 0</pose></light>
  <scene><ambient>.4 .4 .4 1</ambient></scene>
  <frame name="corner"><pose>1 2 0 0 0 1.5</pose></frame>
  <model name="ground_plane"><static>true</static><link name="l"><collision name="c"><geometry>
    <plane><normal>0 0 1</normal><size>9 9</size></plane></geometry>
    <surface><friction><ode><mu>0.7</mu></ode></friction></surface></collision></link></model>
  <model name="table"><static>true</static><pose relative_to="corner">0.5 0 0 0 0 0</pose>
    <link name="top"><pose>0 0 .5 0 0 0</pose>
      <collision name="c"><geometry><box><size>1 1 .1</size></box></geometry></collision></link>
    <link name="foot"><collision name="c"><geometry><box><size>.1 .1 .4</size></box></geometry></collision></link>
  </model>
  <include><uri>ball.sdf</uri><name>ball</name>
    <pose relative_to="table::top">0 0 .5 0 1.5707963267948966 0</pose></include>
  <model name="door"><pose>0 -1 0 0 0 .3</pose><link name="leaf"><pose>0 0 1 0 0 0</pose>
      <collision name="c"><geometry><box><size>.8 .05 1.8</size></box></geometry></collision></link>
    <joint name="hinge" type="revolute"><parent>world</parent><child>leaf</child>
      <axis><xyz>0 0 1</xyz><limit><lower>0</lower><upper>1</upper></limit></axis></joint></model>
</world></sdf>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("scene")
    (made / "room.sdf").write_text(SCENE)
    (made / "ball.sdf").write_text(BALL)
    (made / "world.yaml").write_text("world:\n  source: room.sdf\n")
    return made


@pytest.fixture(scope="module")
def world(folder: Path) -> World:
    return compile_world(folder / "world.yaml")


def place(world: World, name: str) -> np.ndarray:
    return world.initial_body_pose[next(i for i, body in enumerate(world.bodies) if body.name == name)]


def test_trees_are_objects_at_their_places(world: World) -> None:
    kinds = {entity.name: world.bodies[entity.root].kind for entity in world.entities}
    fixed = BodyKind.STATIC
    assert kinds == {"table_top": fixed, "table_foot": fixed, "ball": BodyKind.FREE, "door": fixed}
    middle = np.array([1 + 0.5 * cos(1.5), 2 + 0.5 * sin(1.5), 0.0])
    assert place(world, "table_top.top")[:3] == pytest.approx(np.add(middle, (0, 0, 0.5)), abs=1e-12)
    assert place(world, "table_foot.foot")[:3] == pytest.approx(middle, abs=1e-12)
    ball = place(world, "ball.it")
    assert ball[:3] == pytest.approx(
        np.add(middle, (0, 0, 1.0 - 0.1)), abs=1e-12
    )  # its link is 0.1 ahead, which points down
    assert P.rotate(ball[3:], np.array([1.0, 0, 0])) == pytest.approx([0, 0, -1], abs=1e-12)
    assert place(world, "door.leaf")[:3] == pytest.approx([0, -1, 1], abs=1e-12)
    assert next(body for body in world.bodies if body.name == "ball.it").inertial.mass == 2.0


def test_the_world_around_them_is_that_of_the_file(world: World) -> None:
    assert (world.name, world.physics.gravity, world.physics.dt) == ("room", (0.0, 0.0, -9.0), 0.001)
    assert world.geoms[0].body == WORLD
    assert world.geoms[0].surface.friction == 0.7
    sun, lamp = world.lights
    assert sun.position is None
    assert sun.intensity == 0.8
    assert sun.color == (1.0, 1.0, 0.5)
    assert lamp.position == pytest.approx((1 + cos(1.5), 2 + sin(1.5), 2.0), abs=1e-12)
    assert world.scenery.ambient == (0.4, 0.4, 0.4)


def test_what_is_not_in_the_world_is_told(folder: Path) -> None:
    report = compile_with_report(load(folder / "world.yaml").spec, base=folder).report
    told = " ".join(map(str, report["source"]))
    for words in ("<plugin>", "<ode>", "<cast_shadows>", "is called 'table_top'"):
        assert words in told
    assert "<plane>" not in told


def test_a_second_level_plane_is_told(tmp_path: Path) -> None:
    """The first is the ground; the other has nowhere to go."""
    start, end = SCENE.index('<model name="ground_plane">'), SCENE.index('<model name="table">')
    other = SCENE[start:end].replace("ground_plane", "carpet")
    (tmp_path / "two.sdf").write_text(f'<sdf version="1.9"><world name="w">{SCENE[start:end]}{other}</world></sdf>')
    spec = load({"world": {"source": str(tmp_path / "two.sdf")}}).spec
    told = " ".join(map(str, compile_with_report(spec, base=tmp_path).report["source"]))
    assert (
        "model 'carpet': is a level plane at height 0 as 'ground_plane' is, which is the ground; it is left out" in told
    )


def test_faults_have_the_line_of_the_file(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "ball.sdf").write_text(BALL)
    (tmp_path / "world.yaml").write_text("world: {source: room.sdf}\n")
    for old, new, message in (
        ('relative_to="corner"', 'relative_to="korner"', "there is no frame 'korner'; did you mean 'corner'"),
        ("ball.sdf", "../../ball.sdf", r"room\.sdf:19: includes '\.\./\.\./ball\.sdf', which (leaves|does not exist)"),
        ("0 0 -9.0", "0 0 down", r"room\.sdf:3: <gravity> is '0 0 down'"),
        ("</world>", "</world><world/>", "has 2 worlds"),
    ):
        (tmp_path / "room.sdf").write_text(SCENE.replace(old, new))
        with pytest.raises(SpecError, match=rf"world\.yaml:1:\d+: world\.source: .*{message}"):
            load(tmp_path / "world.yaml")
    (tmp_path / "room.sdf").write_text(SCENE.replace("0.001<", "0<"))
    with pytest.raises(SpecError, match=r"room\.sdf:4:1: physics\.dt"):
        load(tmp_path / "world.yaml")


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_build_what_was_read(engine: str, folder: Path) -> None:
    with make(watched(load(folder / "world.yaml", overrides=[f"engine={engine}"])), base=folder) as env:
        assert [line for line in audit(env.engine) if not line.ok] == []

"""Whole MJCF files as worlds: bodies as objects at their places, lights, cameras, ground; what is lost is told."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from anysim.api import compile_world, load, make, watched
from anysim.compile.world import compile_with_report
from anysim.conventions import WORLD
from anysim.errors import AnysimError, CapabilityError, SpecError
from anysim.math import pose as P
from anysim.model.world import BodyKind, World
from anysim.testing.audit import audit
from tests.tiers import ENGINES, often

SCENE = """<mujoco model="kitchen">
  <option gravity="0 0 -9.8" timestep="0.004"/>
  <asset><mesh name="wedge" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset>
  <worldbody>
    <light name="lamp" pos="0 0 3" dir="0 0.2 -1" diffuse=".4 .4 .2"/>
    <camera name="eye" pos="0 -2 1.5" xyaxes="1 0 0 0 0.5 1" fovy="50" resolution="64 48"/>
    <camera name="rolled" pos="0 -2 1.5" xyaxes="0 0 1 0 1 0"/>
    <geom name="floor" type="plane" size="4 4 .1" friction="0.6"/>
    <geom name="counter" type="box" size=".5 .3 .4" pos="0 1 .4"/>
    <geom name="wall" type="plane" size="4 4 .1" pos="0 3 0" euler="90 0 0"/>
    <site name="corner" pos="1 1 0"/>
    <body name="shelf" pos="1 1 1" euler="0 0 30"><geom type="box" size=".2 .2 .01"/></body>
    <body name="cup" pos="0 1 .86"><freejoint/><geom name="cup.side" type="cylinder" size=".04 .05"/>
      <body name="cup.handle" pos="0.05 0 0"><geom size="0.01"/></body></body>
    <body name="door/1" pos="-1 1 .5">
      <joint name="hinge" axis="0 0 1" range="0 90" damping="1" ref="10"/>
      <geom type="box" size=".3 .02 .4" pos=".3 0 0"/>
      <camera name="riding" pos="0 0 1"/></body>
    <frame pos="0 -1 0"><body pos="0 0 .5" euler="20 90 0"><freejoint/><geom type="mesh" mesh="wedge"/></body></frame>
    <body name="ghost" pos="0 0 2"><freejoint/><geom size="0.1" contype="4" conaffinity="4"/></body>
  </worldbody>
  <sensor><touch site="corner"/></sensor>
  <actuator><motor joint="hinge"/></actuator>
  <equality><weld body1="cup" body2="ghost"/></equality>
  <keyframe><key name="home" qpos="0 1 .9 1 0 0 0 .3 0 -1 .7 1 0 0 0 0 0 2 1 0 0 0"/></keyframe>
</mujoco>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("scene")
    (made / "kitchen.xml").write_text(SCENE)
    (made / "world.yaml").write_text("world:\n  source: file:kitchen.xml\n")
    return made


@pytest.fixture(scope="module")
def world(folder: Path) -> World:
    return compile_world(folder / "world.yaml")


def test_bodies_stand_where_mujoco_has_them_with_their_masses(folder: Path, world: World) -> None:
    model = mujoco.MjModel.from_xml_path(str(folder / "kitchen.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    names = {"cup": "cup", "shelf": "shelf", "ghost": "ghost", "door_1.door/1": "door/1", "body_4": ""}
    for here, there in names.items():
        number = next(i for i, body in enumerate(world.bodies) if body.name == here)
        body = model.body(there or 5).id
        assert world.initial_body_pose[number, :3] == pytest.approx(data.xpos[body], abs=1e-12)
        turn = np.array([*data.xquat[body][1:], data.xquat[body][0]])
        assert float(P.angle_between(world.initial_body_pose[number, 3:], turn)) < 1e-7
        if there != "shelf":
            mass = model.body_subtreemass[body]
            assert world.bodies[number].inertial.mass == pytest.approx(mass, rel=1e-12)
    kinds = {entity.name: world.bodies[entity.root].kind for entity in world.entities}
    still = {name for name, kind in kinds.items() if kind is BodyKind.STATIC}
    assert still == {"surroundings", "shelf", "door_1"}
    assert world.joints[0].initial == pytest.approx(0.3)
    assert world.joints[0].damping == 1.0


def test_ground_physics_lights_and_cameras_are_those_of_the_file(world: World) -> None:
    assert world.name == "kitchen"
    assert world.physics.gravity == (0.0, 0.0, -9.8)
    assert world.physics.dt == 0.004
    ground = world.geoms[0]
    assert ground.name == "terrain"
    assert ground.body == WORLD
    assert ground.surface.friction == 0.6
    (lamp,) = world.lights
    assert lamp.position == (0.0, 0.0, 3.0)
    assert lamp.intensity == 0.4
    assert lamp.color == (1.0, 1.0, 0.5)
    cameras = {camera.name: camera for camera in world.cameras}
    assert (cameras["eye"].fov, cameras["eye"].width, cameras["eye"].height) == (50.0, 64, 48)
    ahead = P.rotate(np.array(cameras["eye"].quaternion), np.array([0.0, 0.0, 1.0]))
    assert ahead == pytest.approx(np.array([0.0, 2.0, -1.0]) / 5**0.5, abs=1e-12)
    right = P.rotate(np.array(cameras["rolled"].quaternion), np.array([1.0, 0.0, 0.0]))
    assert right == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)
    assert world.bodies[cameras["riding"].body].name == "door_1.door/1"


def test_what_the_masks_keep_apart_never_collides(world: World) -> None:
    ghost = next(i for i, body in enumerate(world.bodies) if body.name == "ghost")
    others = {WORLD, *range(len(world.bodies))} - {ghost}
    assert world.excluded_pairs == {(min(ghost, other), max(ghost, other)) for other in others}


def test_what_is_not_in_the_world_is_told(folder: Path) -> None:
    notes = compile_with_report(load(folder / "world.yaml").spec, base=folder).report
    told = {name: " ".join(map(str, found)) for name, found in notes.items()}
    assert "a touch is left out: it is on no body that something can touch" in told["surroundings"]
    assert "'door/1': is called 'door_1'" in told["source"]
    assert "becomes a box of 8 m by 8 m" in told["surroundings"]
    assert "1 drives of its file are left out" in told["door_1"]
    assert "equalities between it and other bodies of the file are left out" in told["cup"]
    assert "sensors" not in told["cup"]
    assert "contype" not in told["ghost"]


def test_a_file_says_more_of_what_a_scene_holds(folder: Path) -> None:
    changes = ["world.objects.ghost=null", "world.layout.ghost=null", "world.collisions=null"]
    loaded = load(folder / "world.yaml", overrides=[*changes, "world.objects.cup.mass=2", "physics.gravity=[0, 0, -1]"])
    world = compile_world(loaded)
    assert "ghost" not in {entity.name for entity in world.entities}
    assert next(body for body in world.bodies if body.name == "cup").inertial.mass == pytest.approx(2.0)
    assert world.physics.gravity == (0.0, 0.0, -1.0)
    again = compile_world(watched(loaded), base=folder)
    assert again.hash == world.hash, "a scene that has been read is not read again"
    assert compile_world(loaded.spec, base=folder).hash == world.hash


def test_faults_have_the_line_of_the_file(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "kitchen.xml").write_text(
        SCENE.replace('<geom type="box" size=".2', '<joint type="ball"/><geom type="box" size=".2')
    )
    (tmp_path / "world.yaml").write_text("world: {source: kitchen.xml}\n")
    with pytest.raises(AnysimError, match=r"kitchen\.xml:12:1: world\.objects\.shelf\.source.*ball joint"):
        compile_world(tmp_path / "world.yaml")
    with pytest.raises(SpecError, match=r"control_dt .* whole multiple of dt .0\.004"):
        load(folder / "world.yaml", overrides=["physics.control_dt=0.005"])
    for text, message in (
        ("<mujoco><worldbody><body></worldbody></mujoco>", "not well-formed XML"),
        ('<mujoco><include file="../../etc/passwd.xml"/></mujoco>', r"leaves|does not exist"),
    ):
        (tmp_path / "kitchen.xml").write_text(text)
        with pytest.raises(SpecError, match=rf"world\.yaml:1:\d+: world\.source: .*({message})"):
            load(tmp_path / "world.yaml")
    (tmp_path / "kitchen.xml").write_text(f"<mujoco><worldbody>{'<body/>' * 201}</worldbody></mujoco>")
    with pytest.raises(SpecError, match="the limit of a scene file is 200 bodies"):
        load(tmp_path / "world.yaml")
    with pytest.raises(SpecError, match="leave '#cup' out"):
        load({"world": {"source": f"{folder / 'kitchen.xml'}#cup"}})
    with pytest.raises(SpecError, match="has not been read"):
        compile_with_report(load({"world": {}}).spec.model_copy(update={"world": _unread()}))


def _unread() -> object:
    from anysim_schemas.run import WorldSpec

    return WorldSpec.model_validate({"source": "kitchen.xml"})


@pytest.mark.parametrize("engine", often(["mujoco"], ENGINES))
def test_engines_build_what_was_read_and_it_falls(engine: str, folder: Path) -> None:
    overrides = [f"engine={engine}", "world.cameras=null"]
    with make(watched(load(folder / "world.yaml", overrides=overrides)), base=folder) as env:
        simulation = env.engine
        assert [line for line in audit(simulation) if not line.ok] == []
        simulation.reset()
        simulation.step(5)
        state, world = simulation.get_state(), simulation.world
        number = next(i for i, body in enumerate(world.bodies) if body.name == "ghost")
        assert state.body_pose[0, number, 2] == pytest.approx(2 - 0.5 * 9.8 * (5 * 0.004) ** 2, abs=2e-3)


def test_what_an_engine_lacks_is_refused_with_the_line_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "kitchen.xml").write_text("""<mujoco><worldbody>
  <body name="arm"><joint name="a"/><geom size=".1"/><body><joint name="b"/><geom size=".1"/></body></body></worldbody>
  <tendon><fixed name="t" range="-1 1"><joint joint="a" coef="1"/><joint joint="b" coef="1"/></fixed></tendon>
  </mujoco>""")
    (tmp_path / "world.yaml").write_text("engine: pybullet\nworld: {source: kitchen.xml}\n")
    with pytest.raises(CapabilityError, match=r"tendon 'arm\.t' is limited .* at .*kitchen\.xml:2:1"):
        make(watched(load(tmp_path / "world.yaml")), base=tmp_path)

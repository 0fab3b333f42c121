"""`anysim export-model`: what is written of robots and worlds, and what is said of the rest."""

from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from anysim.api import compile_world, load
from anysim.assets.load import import_asset
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.model.world import World
from anysim_export_model.scene import scene_of, scene_of_model, scene_of_world
from anysim_export_model.write import write

MJCF = """<mujoco><compiler autolimits="true"/><worldbody><body name="base"><geom type="box" size="0.1 0.1 0.1"/>
  <body name="arm" pos="0.3 0 0"><joint name="turn" axis="0 1 0" pos="0.05 0 0.02" range="-90 90" armature="0.1"
    stiffness="2" springref="20" solreflimit="0.03 1"/><geom type="capsule" size="0.02 0.1" friction="0.4"/>
    <body name="hand" pos="0 0 0.2"><joint name="slide" type="slide" axis="0 0 1"/><geom size="0.03"/>
      <site name="tip" pos="0 0 0.05" euler="0 90 0"/></body></body></body></worldbody>
<actuator><position joint="turn" kp="50" kv="5" forcerange="-20 20"/></actuator></mujoco>"""


@pytest.fixture(scope="module")
def world() -> World:
    """A floating robot, a ball, a box that stands still, a camera and a lamp on a plane."""
    return compile_world(
        load(
            {
                "world": {
                    "robots": {"dog": {"robot": "unitree_go1", "position": [1, 0, 0]}},
                    "objects": {
                        "ball": {"source": {"sphere": 0.1}, "mass": 2.0},
                        "block": {"source": {"box": [0.2, 0.3, 0.4]}, "fixed": True},
                    },
                    "cameras": {"front": {"from": [2, 0, 1], "look_at": [0, 0, 0.2]}},
                }
            }
        )
    )


def test_a_world_becomes_one_mjcf_file_that_mujoco_builds_alike(world: World, tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    written = write(scene_of_world(world), "mjcf", tmp_path)
    model = mujoco.MjModel.from_xml_path(str(written.files[0]))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    for body, pose in zip(world.bodies, world.initial_body_pose, strict=True):
        number = model.body(body.name).id
        assert data.xpos[number] == pytest.approx(pose[:3], abs=1e-9)
        assert abs(np.dot(np.roll(data.xquat[number], -1), pose[3:])) == pytest.approx(1.0, abs=1e-9)
        assert model.body_mass[number] == pytest.approx(body.inertial.mass, rel=1e-12)
    assert model.opt.timestep == world.physics.dt
    assert model.nu == len(world.actuators)
    assert model.actuator_gainprm[:, 0] == pytest.approx([a.kp for a in world.actuators])
    assert {model.camera(c).name for c in range(model.ncam)} == {camera.name for camera in world.cameras}
    mujoco.mj_camlight(model, data)
    ahead = P.rotate(np.array(world.cameras[0].quaternion), np.array([0.0, 0.0, 1.0]))
    assert -data.cam_xmat[0].reshape(3, 3)[:, 2] == pytest.approx(ahead, abs=1e-9)


def test_each_entity_of_a_world_becomes_a_urdf(world: World, tmp_path: Path) -> None:
    written = write(scene_of_world(world), "urdf", tmp_path)
    assert {path.name for path in written.files} >= {"dog.urdf", "dog.srdf", "ball.urdf", "block.urdf"}
    told = "\n".join(map(str, written.notes))
    assert "free root: is not in the file" in told
    assert "camera: is left out" in told
    assert "geom of the world: is left out" in told
    groups = etree.parse(tmp_path / "dog.srdf")
    assert len(groups.findall("group/joint")) == 12
    assert groups.find("group_state").get("name") == "home"
    one = write(scene_of_world(world), "urdf", tmp_path / "one", entities=("ball",))
    assert [path.name for path in one.files] == ["ball.urdf"]
    with pytest.raises(AnysimError, match="no entity 'bal'; did you mean 'ball'"):
        write(scene_of_world(world), "urdf", tmp_path / "two", entities=("bal",))


def test_what_a_format_has_and_what_it_lacks_is_told(tmp_path: Path) -> None:
    source = tmp_path / "arm.xml"
    source.write_text(MJCF)
    model = import_asset(str(source))
    written = write(scene_of_model(model), "urdf", tmp_path / "urdf")
    told = {note.where: note.kind for note in written.notes}
    assert told["armature of a joint"] == told["gains of a drive"] == told["surface"] == "dropped"
    assert told["softness of a joint's limits"] == "dropped"
    assert told["anchor of a joint"] == told["spring of a joint"] == told["slide without limits"] == "info"
    again = import_asset(str(written.files[0]))
    assert again.links["arm"] == 1
    assert again.bodies[1].name == "arm.anchor"
    assert next(site for site in again.sites if site.name == "arm").position == (-0.05, 0.0, -0.02)
    assert (again.joints[0].stiffness, again.joints[0].lower) == (model.joints[0].stiffness, model.joints[0].lower)
    back = import_asset(str(write(scene_of_model(model), "mjcf", tmp_path / "mjcf").files[0]))
    assert back.joints == model.joints
    assert back.actuator_hints == model.actuator_hints


def test_angles_of_a_right_angle_are_exact() -> None:
    rng = np.random.default_rng(0)
    for pitch in (np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-8, 0.3):
        for _ in range(20):
            turn = P.from_roll_pitch_yaw(np.array([rng.uniform(-3, 3), pitch, rng.uniform(-3, 3)]))
            again = P.from_roll_pitch_yaw(P.exact_roll_pitch_yaw(turn))
            assert abs(P.to_matrix(again) - P.to_matrix(turn)).max() < 1e-15 * 8


def test_a_robot_is_found_by_its_name(tmp_path: Path) -> None:
    scene = scene_of("franka_panda")
    assert set(scene.pieces[0].channels) == {"arm", "eef"}
    with pytest.raises(AnysimError, match="no robot, task or file 'franka_pnda'; did you mean 'franka_panda'"):
        scene_of("franka_pnda")

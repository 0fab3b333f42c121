"""Live editing: things come and go, and everything else goes on as it was."""

from importlib.metadata import EntryPoint

import numpy as np
import pytest

from anysim import registry
from anysim.engine.capability import Capability as C
from anysim.errors import AnysimError, SnapshotError
from anysim.testing import tolerances, worlds
from anysim.testing.compare import assert_close, assert_same, play, read, spread, tape
from anysim.testing.fixtures import skip_without_parameter

CRATE = {"source": {"box": [0.2, 0.2, 0.2]}, "mass": 1.5, "position": (3.0, 3.0, 0.5)}

TWO_LINK = """
<robot name="two_link">
  <link name="base"/>
  <link name="link">
    <inertial><origin xyz="0 0 0.1"/><mass value="0.4"/>
      <inertia ixx="0.002" iyy="0.002" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.1"/><geometry><box size="0.04 0.04 0.2"/></geometry></collision>
  </link>
  <joint name="hinge" type="revolute">
    <parent link="base"/><child link="link"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="20" velocity="5"/>
  </joint>
</robot>
"""
CATALOGUE = """
name: contract_two_link
description: one hinge
source: file:two_link.urdf
license: Apache-2.0
license_source: this test
category: arm
channels: {arm: {joints: [hinge], gains: {kp: 50, kd: 5}}}
home: {hinge: 0.25}
tools: {tool: {link: link, position: [0, 0, 0.2]}}
"""


@pytest.fixture
def two_link(tmp_path, monkeypatch):
    """The name of a small robot that is in the catalogue for the time of the test."""
    if "urdf" not in registry.names("importers"):
        pytest.skip("the robot is a URDF file: pip install anysim-urdf")
    package = tmp_path / "contract_two_link_package"
    package.mkdir()
    (package / "two_link.urdf").write_text(TWO_LINK)
    (package / "contract_two_link.yaml").write_text(CATALOGUE)
    monkeypatch.syspath_prepend(tmp_path)
    known = registry.entry
    ours = EntryPoint("contract_two_link", "contract_two_link_package", "anysim.robots")
    monkeypatch.setattr(registry, "entry", lambda kind, name: ours if name == ours.name else known(kind, name))
    return ours.name


def _by_name(engine, without=()):
    """Poses, twists, joints and clocks of everything but what is left out, by name."""
    state = engine.get_state()
    parts = {"time": np.array(state.time)}
    for i, body in enumerate(engine.world.bodies):
        if body.name.split(".")[0] not in without:
            parts[f"{body.name} pose"], parts[f"{body.name} twist"] = state.body_pose[:, i], state.body_twist[:, i]
    for i, joint in enumerate(engine.world.joints):
        if joint.name.split(".")[0] not in without:
            parts[joint.name] = np.stack([state.joint_pos[:, i], state.joint_vel[:, i]])
    return parts


def _running(build, num_envs=2):
    engine = build(worlds.scene(), num_envs)
    spread(engine)
    play(engine, tape(engine.world, range(num_envs), 20))
    return engine


def _add(engine, name="crate", **changes):
    engine.add_object(name, **(CRATE | changes))


def test_an_added_object_is_there(build):
    """An added object has its pose, mass and name in every env, and moves from then on."""
    engine = _running(build)
    _add(engine)
    crate = engine.index.body("crate")
    pose = engine.get_state().body_pose[:, crate]
    assert_close(pose, np.array([3.0, 3.0, 0.5, 0.0, 0.0, 0.0, 1.0]), tolerances.READ_BACK, "pose of the crate")
    assert engine.world.bodies[crate].inertial.mass == pytest.approx(1.5)
    engine.set_body_state(twist=[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], bodies=[crate])
    engine.step(20)
    assert_close(engine.get_state().body_pose[:, crate, 0], 3.04, 0.005, "the crate after 40 ms at 1 m/s")


def test_adding_leaves_the_others(build):
    """Adding an object far away leaves every other state, clock and command bit for bit; they go on as before."""
    engine, alone = _running(build), _running(build)
    before = _by_name(engine)
    _add(engine)
    assert_same(_by_name(engine, ("crate",)), before, "right after adding")
    for e in (engine, alone):
        e.step(10)  # under the commands from before
    targets = tape(alone.world, [0, 1], 10, seed=5)
    for e in (engine, alone):
        play(e, targets)
    after, wanted = _by_name(engine, ("crate",)), _by_name(alone)
    for name, value in wanted.items():
        assert_close(after[name], value, tolerances.TRANSIENT, f"{name}, 30 steps after adding")


@pytest.mark.parametrize("name", ["table", "box", "ball"])
def test_removing_leaves_the_others(build, name):
    """Removing an object, fixed or free, first or last, leaves the others bit for bit, in their order."""
    engine = _running(build)
    before = _by_name(engine, (name,))
    engine.remove_object(name)
    assert name not in [e.name for e in engine.index.objects]
    assert_same(_by_name(engine), before, f"right after removing {name}")
    engine.step(10)
    assert not engine.get_state().fault.any()


def test_removing_a_robot_leaves_the_others(build):
    """A robot leaves with its joints and drives."""
    engine = _running(build)
    before = _by_name(engine, ("arm",))
    engine.remove_robot("arm")
    assert engine.list_robots() == []
    assert engine.get_state().joint_pos.shape == (2, 0)
    assert_same(_by_name(engine), before, "right after removing the arm")
    engine.step(10)


def test_an_added_robot_works(build, two_link):
    """A robot of the catalogue joins with its own home and drives; the others stay, and it leaves again."""
    engine = _running(build)
    before = _by_name(engine)
    engine.add_robot("left", two_link, position=(0.0, 5.0, 0.5))
    assert engine.list_robots() == ["arm", "left"]
    assert engine.robot_joint_names("left") == ["hinge"]
    assert_same(_by_name(engine, ("left",)), before, "right after adding a robot")
    joint = engine.index.joint("left.hinge")
    assert_close(engine.get_state().joint_pos[:, joint], 0.25, tolerances.READ_BACK, "its home")
    engine.send_action({"hinge": -0.3}, "left", n_substeps=1500)
    assert_close(engine.get_state().joint_pos[:, joint], -0.3, tolerances.LIMIT, "its target")
    engine.remove_robot("left")
    assert engine.list_robots() == ["arm"]


def test_adding_and_removing_is_as_before(build):
    """An object that came and went leaves nothing: same world, same states."""
    engine = _running(build)
    world, before = engine.world.hash, read(engine)
    _add(engine)
    engine.remove_object("crate")
    assert engine.world.hash == world
    assert_same(read(engine), before, "after adding and removing")


def test_a_removed_support_is_gone(build):
    """What lay on a removed object falls, where the engine has dynamics."""
    engine = build(worlds.scene())
    engine.step(200)
    box = engine.index.body("box")
    height = engine.get_state().body_pose[0, box, 2]
    engine.remove_object("table")
    engine.step(50)
    fallen = height - engine.get_state().body_pose[0, engine.index.body("box"), 2]
    if C.DYNAMICS in engine.capabilities:
        assert fallen > 0.03
    else:
        assert fallen == 0.0


def test_changed_parameters_survive(build, engine_class):
    """Parameters changed per env stay with their bodies."""
    skip_without_parameter(engine_class, "body.mass")
    engine = _running(build)
    ball = engine.index.body("ball")
    engine.set_parameters("body.mass", [[0.77]], [1], [ball])
    engine.remove_object("table")
    _add(engine)
    masses = engine.get_parameters("body.mass", indices=[engine.index.body("ball"), engine.index.body("crate")])
    assert np.allclose(masses, [[0.5, 1.5], [0.77, 1.5]], rtol=tolerances.READ_BACK)


def test_placed_bodies_stay(build):
    """Fixed bodies that were placed anew stay there through an edit."""
    engine = build(worlds.scene(), 2)
    engine.set_body_state(pose=[0.3, 0.9, 0.5, 0.0, 0.0, 0.0, 1.0], env_ids=[1], bodies=[engine.index.body("table")])
    before = _by_name(engine)
    _add(engine)
    assert_same(_by_name(engine, ("crate",)), before, "with a placed table")


def test_reset_knows_the_new_world(build):
    """After an edit `reset` goes to the new world's initial state."""
    engine = _running(build)
    _add(engine)
    engine.step(5)
    engine.reset([0])
    pose = engine.get_state().body_pose[0]
    assert_close(pose[:, :3], engine.world.initial_body_pose[:, :3], tolerances.KINEMATICS, "initial positions")


def test_old_states_and_snapshots(build, engine_class):
    """Arrays read before an edit stay; a snapshot from before it belongs to another world and is refused."""
    engine = _running(build)
    held = engine.get_state().body_pose
    kept = held.copy()
    snapshot = engine.snapshot() if C.SNAPSHOT_TRAJECTORY in engine_class.capabilities else None
    _add(engine)
    engine.step(3)
    assert np.array_equal(held, kept)
    if snapshot is not None:
        with pytest.raises(SnapshotError, match="world"):
            engine.restore(snapshot)


@pytest.mark.parametrize(
    "change",
    [
        {"name": "box"},
        {"name": "arm"},
        {"source": {"bx": [1, 1, 1]}},
        {"source": {"box": [0.1, 0.1, -0.1]}},
        {"masss": 1.0},
    ],
    ids=["name-taken", "name-of-a-robot", "unknown-shape", "negative-size", "unknown-key"],
)
def test_a_wrong_edit_changes_nothing(build, change):
    """An object that cannot be added is an error; the world, its state and its future are as before."""
    engine, clean = _running(build), _running(build)
    before, world = read(engine), engine.world
    with pytest.raises(AnysimError):
        _add(engine, **change)
    assert engine.world is world
    assert_same(read(engine), before, "after the refused edit")
    for e in (engine, clean):
        e.step(10)
    assert_same(read(engine), read(clean), "10 steps after the refused edit")


def test_an_added_camera_sees(build, engine_class):
    """`add_camera` adds a view without a rebuild; the state and the other cameras stay."""
    engine = _running(build)
    before = read(engine)
    engine.add_camera("top", **{"from": (0.0, 0.0, 3.0), "look_at": (0.5, 0.0, 0.0), "size": (32, 24)})
    assert_close(engine.camera_poses("top")[:, :3], np.array([0.0, 0.0, 3.0]), tolerances.READ_BACK, "its place")
    assert_same(read(engine), before, "after adding a camera")
    if C.RENDER_RGB in engine_class.capabilities:
        assert engine.render("top")["rgb"].shape == (2, 24, 32, 3)

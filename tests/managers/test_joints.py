"""Joints of objects, episode by episode: where they begin, how they resist, and what terms see of them."""

import subprocess
import sys
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim import registry
from anysim.compile.edit import with_object
from anysim.engine.capability import Capability
from anysim.engine.factory import runnable
from anysim.errors import SpecError
from anysim.managers.randomized_parameters import SceneParameterManager
from anysim.model.world import Slot, World
from anysim.randomization.streams import Streams
from anysim.task.env import TaskEnv
from anysim.task.joints import JointView, RangedJointView
from anysim.task.scene import SceneView
from anysim.testing.kinematic import NullEngine

KITCHEN: dict[str, Any] = {
    "engine": "null",
    "physics": {"dt": 0.002, "control_dt": 0.02},
    "world": {
        "name": "kitchen",
        "objects": {
            "cabinet": {
                "source": "procedural:cabinet",
                "fixed": True,
                "joints": {
                    "drawer_*": {"opened": {"range": [0.0, 0.3]}},
                    "drawer_3": {"initial": 0.05, "friction": {"log_uniform": [2.0, 10.0]}},
                    "door_1": {"initial": {"normal": {"mean": 0.1, "std": 0.5}}, "damping": {"choice": [0.1, 0.4]}},
                },
            },
            "tap": {"source": "procedural:valve", "fixed": True},
        },
        "layout": {"cabinet": {"position": [0, 0, 0]}, "tap": {"position": [0, 0, 0.7]}},
    },
    "task": {
        "horizon": 20,
        "observations": {
            "policy": [
                {"term": "object_joint_pos", "object": "cabinet"},
                {"term": "object_joint_vel", "object": "cabinet"},
                {"term": "joint_opening", "joint": "cabinet.drawer_1"},
                {"term": "frame_pose", "frame": "cabinet.drawer_1.handle"},
                {"term": "frame_twist", "frame": "cabinet.door_1.handle"},
            ]
        },
        "rewards": {"progress": {"term": "joint_progress", "joint": "cabinet.drawer_1", "target": 0.5}},
        "success": {"opened": {"joint": "cabinet.drawer_1", "share": 0.75}, "joint_still": {"joint": "tap.wheel"}},
        "failure": {"turned": {"term": "joint_above", "joint": "tap.wheel", "position": 1.0}},
    },
}


def kitchen(num_envs: int = 1, *overrides: str, engine: str = "null") -> TaskEnv:
    return anysim.make(KITCHEN, engine=engine, num_envs=num_envs, overrides=overrides)


def test_joints_begin_where_the_spec_says() -> None:
    with kitchen(64) as env:
        env.reset(seed=0)
        world, state = env.engine.world, env.engine.get_state()
        position = {joint.name: state.joint_pos[:, i] for i, joint in enumerate(world.joints)}
        upper = {joint.name: joint.upper for joint in world.joints}
        for name in ("cabinet.drawer_1", "cabinet.drawer_2"):
            share = position[name] / upper[name]
            assert 0.0 <= share.min() < 0.03
            assert 0.27 < share.max() <= 0.3
        assert not np.allclose(position["cabinet.drawer_1"], position["cabinet.drawer_2"])
        assert (position["cabinet.drawer_3"] == 0.05).all()
        door = position["cabinet.door_1"]
        assert door.min() == 0.0, "a normal is clipped to the limits"
        assert 0.5 < door.max() <= upper["cabinet.door_1"]
        assert not state.joint_vel.any()


@pytest.mark.parametrize("name", runnable())
def test_draws_are_noted_with_their_stream_and_source_and_read_back(name: str) -> None:
    with kitchen(8, engine=name) as env:
        env.reset(seed=3)
        index, draws = env.engine.index, env.streams.draws
        joint = index.joint("cabinet.drawer_3")
        friction = env.engine.get_parameters("joint.friction", indices=[joint])[:, 0]
        assert np.allclose(friction, [d["joints/cabinet/drawer_3/friction"] for d in draws], rtol=1e-6)
        assert 2.0 <= friction.min() < friction.max() <= 10.0
        damping = env.engine.get_parameters("joint.damping", indices=[index.joint("cabinet.door_1")])[:, 0]
        assert np.allclose(damping, [d["joints/cabinet/door_1/damping"] for d in draws], rtol=1e-6)
        assert len(set(damping)) == 2
        origin = env.streams.origins[0]["joints/cabinet/drawer_2/opened"]
        assert origin == ("joints/cabinet/drawer_2/opened", "world.objects.cabinet.joints.drawer_*.opened")
        assert set(draws[0]) == {
            "joints/cabinet/drawer_1/opened",
            "joints/cabinet/drawer_2/opened",
            "joints/cabinet/drawer_3/friction",
            "joints/cabinet/door_1/initial",
            "joints/cabinet/door_1/damping",
        }


def test_another_draw_moves_none_and_env_i_does_not_depend_on_how_many_there_are() -> None:
    with kitchen(2) as two, kitchen(5, "world.objects.tap.joints={wheel: {initial: {range: [0, 6]}}}") as five:
        two.reset(seed=4)
        five.reset(seed=4)
        for a, b in zip(two.streams.draws, five.streams.draws[:2], strict=True):
            assert {name: value for name, value in b.items() if "tap" not in name} == a
        assert (two.obs["policy"] == five.obs["policy"][:2]).all()


@pytest.mark.parametrize("name", runnable())
def test_a_snapshot_goes_on_as_the_uninterrupted_run(name: str) -> None:
    """With joints in motion, friction drawn, and other episodes in between."""
    exact = Capability.SNAPSHOT_TRAJECTORY in registry.load("engines", name).capabilities
    if not exact:
        pytest.skip(f"{name} has no exact snapshots")
    with kitchen(2, engine=name) as env:
        env.reset(seed=1)
        joints = len(env.engine.world.joints)
        env.engine.set_joint_state(velocity=np.full((2, joints), 0.4))
        action = np.zeros((2, 0))
        env.step(action)
        snapshot = env.snapshot()
        wanted = [env.step(action).obs["policy"] for _ in range(5)]
        assert (wanted[0] != wanted[-1]).any() or name == "null"
        env.reset(seed=9)
        env.step(action)
        env.reset_to(snapshot)
        for rows in wanted:
            assert (env.step(action).obs["policy"] == rows).all()
        friction = env.engine.get_parameters("joint.friction")
        env.reset(episode_seeds=env.streams.episode_seed)
        assert (env.engine.get_parameters("joint.friction") == friction).all()


@pytest.mark.parametrize("name", runnable())
def test_an_episode_goes_alike_in_another_batch(name: str) -> None:
    """Drawn again from its seed, in another row and among more envs: the same bits."""
    rows: list[list[Any]] = []
    with kitchen(2, engine=name) as two, kitchen(3, engine=name) as three:
        two.reset(seed=6)
        three.reset(seed=7)
        three.step(np.zeros((3, 0)))
        three.reset(mask=np.array([False, True, True]), episode_seeds=two.streams.episode_seed[::-1])
        for env, ids in ((two, [0, 1]), (three, [2, 1])):
            joints = len(env.engine.world.joints)
            env.engine.set_joint_state(velocity=np.full((2, joints), 0.4), env_ids=ids)
            rows.append([env.step(np.zeros((env.num_envs, 0))).obs["policy"][ids] for _ in range(10)])
    for one, other in zip(*rows, strict=True):
        assert (one == other).all()


PROGRAM = """
import sys, hashlib, numpy as np
from tests.managers.test_joints import kitchen
with kitchen(2, engine=sys.argv[1]) as env:
    env.reset(seed=5)
    env.engine.set_joint_state(velocity=np.full((2, len(env.engine.world.joints)), 0.3))
    rows = [env.step(np.zeros((2, 0))).obs["policy"] for _ in range(10)]
print(hashlib.sha256(np.array(rows).tobytes()).hexdigest())
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", runnable())
def test_another_process_sees_the_same_bits(name: str) -> None:
    root = Path(__file__).parents[2]
    command = [sys.executable, "-c", PROGRAM, name]
    runs = [subprocess.run(command, cwd=root, capture_output=True, text=True, check=False) for _ in range(2)]
    assert [run.returncode for run in runs] == [0, 0], runs[0].stderr
    assert len({run.stdout.splitlines()[-1] for run in runs}) == 1


# ---------------------------------------------------------------------- what terms see


def test_terms_read_the_joints_of_objects() -> None:
    with kitchen(3) as env:
        env.reset(seed=0)
        index = env.engine.index
        drawer, wheel = index.joint("cabinet.drawer_1"), index.joint("tap.wheel")
        upper = env.engine.world.joints[drawer].upper
        env.engine.set_joint_state([[0.0], [0.5 * upper], [0.8 * upper]], joints=[drawer])
        result = env.step(np.zeros((3, 0)))
        policy = result.obs["policy"]
        assert np.allclose(policy[:, 0], [0.0, 0.5 * upper, 0.8 * upper])
        assert np.allclose(policy[:, 8], [0.0, 0.5, 0.8])
        # 40 mm before the front, which is 225 mm before the middle
        assert np.allclose(policy[:, 9], np.array([0.0, 0.5, 0.8]) * upper + 0.225 + 0.04, atol=1e-6)
        assert np.allclose(result.reward, [0.5, 1.0, 0.7])
        assert result.status.tolist() == ["running", "running", "success"]
        env.engine.set_joint_state([[1.2], [0.9], [0.0]], joints=[wheel])
        assert env.step(np.zeros((3, 0)), mask=np.array([True, True, False])).status.tolist()[:2] == [
            "failed",
            "running",
        ]


def test_open_is_away_from_the_limit_that_is_nearer_to_zero() -> None:
    """A tray whose range is [-0.2, 0] is open at -0.2."""
    changed = deepcopy(KITCHEN)
    changed["world"]["objects"]["tap"]["joints"] = {"wheel": {"limits": [-0.2, 0.0], "opened": 0.25}}
    changed["task"]["failure"] = {"closed": {"joint": "tap.wheel", "share": 0.2}}
    with anysim.make(changed) as env:
        env.reset(seed=0)
        view = RangedJointView(env.scene, "tap.wheel")
        assert view.position.tolist() == [-0.05]
        assert view.opening.tolist() == [0.25]
        wheel = env.engine.index.joint("tap.wheel")
        assert env.step(np.zeros((1, 0))).status.tolist() == ["running"]
        env.engine.set_joint_state([[-0.01]], joints=[wheel])
        assert env.step(np.zeros((1, 0))).status.tolist() == ["failed"]


def test_names_that_do_not_exist_have_their_keys() -> None:
    def message(*overrides: str) -> str:
        with pytest.raises(SpecError) as caught:
            kitchen(1, *overrides)
        return str(caught.value.issues[0])

    text = message("task.rewards.progress.joint=cabinet.drawer_4")
    assert "task.rewards.progress.joint: 'cabinet' has no joint 'drawer_4'; did you mean 'drawer_3'?" in text
    text = message("task.rewards.progress.joint=cabinett.drawer_1")
    assert "there is no robot or object 'cabinett'; did you mean 'cabinet'?" in text
    text = message("task.rewards.progress.joint=tap.wheel")
    assert "task.rewards.progress.joint: the joint 'tap.wheel' has no limits, so it is neither open nor closed" in text


# ---------------------------------------------------------------------- objects that differ between envs


def _either() -> World:
    """A slot `chest` that is one of two boxes with lids that open differently far."""
    world = World(name="either")
    for number, angle in enumerate((1.0, 2.0)):
        source = {"procedural": "hinge_box", "params": {"lid_angle": angle}}
        spec = {"source": source, "position": [0, number, 0.1], "joints": {"lid": {"initial": 0.1}}}
        world = with_object(world, f"chest{number}", spec)
    return replace(world, slots=(Slot("chest", "chest", 0, (0, 1)),))


def test_a_slot_has_the_joint_of_what_is_there() -> None:
    """The manager draws once for a slot, for the entity that is there; a view reads that one's joint."""
    world = _either()
    lids = {"lid": {"opened": {"choice": [0.5]}}}
    objects = {"chest": {"source": "procedural:hinge_box", "joints": lids}}
    spec = anysim.load({"world": {"objects": objects}}).spec
    engine = NullEngine().create_world(world, 3)
    present = np.array([[True, False], [False, True], [False, False]])
    engine.reset(present=present)
    streams = Streams(3)
    streams.seed(0, np.arange(3))
    streams.begin(np.arange(3))
    manager = SceneParameterManager().configure(spec, streams)
    manager.build(world)
    manager.bind(engine)
    manager.reset(np.arange(3))
    assert [sorted(draws) for draws in streams.draws] == [["joints/chest/lid/opened"]] * 2 + [[]]
    scene = SceneView(engine)
    view = RangedJointView(scene, "chest.lid")
    assert view.position.tolist() == [0.5, 1.0, 0.1]
    assert view.opening[:2].tolist() == [0.5, 0.5]
    assert JointView(scene, "chest1.lid").position[1] == 1.0
    engine.destroy()

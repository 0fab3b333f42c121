"""Frames that terms see of objects that are not the same in every env."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import NameLookupError, SpecError, TaskError
from anysim.math import pose as P
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.task.scene import BodyFrame, ObjectView, SlotFrame
from anysim.task.slot_frames import CategoryView
from tests.task.helpers import arm

HANDLE = """<robot name="{name}"><link name="body"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1"
iyz="0" izz="1"/></inertial><collision><geometry><box size="0.1 0.1 {height}"/></geometry></collision></link>
{handle}</robot>"""
WELD = """<link name="handle"/><joint name="w" type="fixed"><parent link="body"/><child link="handle"/>
<origin xyz="{x} 0 0"/></joint>"""


def made(tmp_path: Path, num_envs: int = 8, **task: Any) -> TaskEnv:
    """A mug that is one of two files with a handle, up to three cubes, and a heap of ten beads."""
    for name, height, x in (("low", 0.1, 0.2), ("high", 0.3, 0.4)):
        (tmp_path / f"{name}.urdf").write_text(HANDLE.format(name=name, height=height, handle=WELD.format(x=x)))
    (tmp_path / "bare.urdf").write_text(HANDLE.format(name="bare", height=0.1, handle=""))
    spec = {
        "engine": "null",
        "world": {
            "objects": {
                "mug": {
                    "source": {"choice": ["low.urdf", "high.urdf"]}, "count": {"choice": [0, 1], "weights": [1, 3]},
                },
                "cube": {"source": {"box": [0.1, 0.1, 0.1]}, "count": {"range": [1, 3]}},
                "beads": {"source": {"sphere": 0.01}, "count": 10, "family": "rigid_instancer"},
                "floor": {"source": {"box": [1, 1, 0.1]}, "fixed": True, "count": 1},
            },
            "layout": {
                "mug": {"on": "terrain", "x": {"range": [0.3, 1.0]}, "yaw": {"range": [-3, 3]}},
                "cube": {"on": "terrain", "y": {"range": [0.3, 1.0]}},
                "floor": {"position": [0, 0, -1]},
            },
        },
        "task": {"horizon": 5, "observations": {"policy": ["last_action"]}} | task,
    }  # fmt: skip
    return anysim.make(spec, num_envs=num_envs, base=tmp_path)


def test_a_frame_follows_what_is_there(tmp_path: Path) -> None:
    with made(tmp_path) as env:
        mug, handle = env.scene.frame("mug"), env.scene.frame("mug.handle")
        assert isinstance(mug, SlotFrame)
        for episode in range(3):
            env.reset(seed=0 if episode == 0 else None)
            env.scene.look(None)
            world, state, presence = env.engine.world, env.engine.get_state(), env.engine.presence
            kinds = set()
            for i in range(env.num_envs):
                there = [e for e in world.logical_objects["mug_0"].entities if presence[i, e]]
                assert mug.present[i] == bool(there)
                kinds.add(tuple(there))
                expected = np.array([0, 0, 0, 0, 0, 0, 1.0])
                offset = expected
                if there:
                    entity = world.entities[there[0]]
                    expected = state.body_pose[i, entity.root]
                    offset = np.array([0.2 if entity.name.endswith("~0") else 0.4, 0, 0, 0, 0, 0, 1.0])
                assert mug.pose[i].tolist() == expected.tolist()
                assert np.allclose(handle.pose[i], P.compose(expected, offset) if there else expected)
            assert len(kinds) > 1


def test_a_frame_off_the_origin_moves_with_its_body(tmp_path: Path) -> None:
    with made(tmp_path) as env:
        env.reset(seed=0)
        env.scene.look(None)
        handle, mug = env.scene.frame("mug.handle"), env.scene.frame("mug")
        assert isinstance(mug, SlotFrame)
        bodies = [e.root for e in ObjectView(env.scene, "mug").entities]
        env.engine.set_body_state(twist=np.tile([0, 0, 0, 0, 0, 2.0], (8, 2, 1)), bodies=bodies)
        env.scene.look(None)
        before, twist = handle.position.copy(), handle.twist.copy()
        env.engine.step(1)
        env.scene.look(None)
        moved = (handle.position - before) / env.engine.world.physics.dt
        assert mug.present.any()
        assert not mug.present.all()
        assert np.allclose(moved, twist[:, :3], atol=2e-3)  # 0.4 m, 2 rad/s: the chord of one step is 1.6e-3 off
        assert np.abs(twist[mug.present, :2]).max() > 0.3
        assert not twist[~mug.present].any()


def test_a_category_is_dense_with_a_mask(tmp_path: Path) -> None:
    with made(tmp_path) as env:
        env.reset(seed=1)
        env.scene.look(None)
        cubes, state = env.scene.category("cube"), env.engine.get_state()
        assert cubes.names == ("cube_0", "cube_1", "cube_2")
        assert cubes.poses.shape == (8, 3, 7)
        assert cubes.present.sum(axis=1).tolist() == [d["population/cube/count"] for d in env.streams.draws]
        roots = [env.engine.index.body(name) for name in cubes.names]
        assert (cubes.poses == state.body_pose[:, roots]).all()
        assert not cubes.positions[~cubes.present].any()
        env.scene.look(np.array([5, 2]))
        assert (cubes.poses == state.body_pose[[5, 2]][:, roots]).all()
        assert cubes.present.shape == (2, 3)


def test_an_instancer_is_a_category_of_its_bodies(tmp_path: Path) -> None:
    with made(tmp_path, 2) as env:
        env.reset(seed=1)
        env.scene.look(None)
        beads = env.scene.category("beads")
        first = env.engine.index.body("beads.0")
        assert len(beads) == 10
        assert beads.names[3] == "beads.3"
        assert (beads.poses == env.engine.get_state().body_pose[:, first : first + 10]).all()


def test_terms_of_categories_and_presence(tmp_path: Path) -> None:
    terms = [
        {"term": "category_present", "category": "cube"}, {"term": "category_pose", "category": "cube"},
        {"term": "category_twist", "category": "cube"}, {"term": "category_offset", "frame": "mug", "category": "cube"},
        {"term": "present", "object": "mug"},
    ]  # fmt: skip
    success = {"there": {"term": "present", "object": "cube_2"}}
    with made(tmp_path, observations={"policy": terms}, success=success) as env:
        obs = env.reset(seed=2)[0]["policy"]
        counts = np.array([d["population/cube/count"] for d in env.streams.draws])
        assert obs.shape == (8, 3 + 21 + 18 + 9 + 1)
        assert obs[:, :3].tolist() == (np.arange(3) < counts[:, None]).astype(float).tolist()
        offsets, here = obs[:, 42:51].reshape(8, 3, 3), obs[:, :3].astype(bool)
        env.scene.look(None)
        mug, cubes = env.scene.frame("mug"), env.scene.category("cube")
        assert np.allclose(
            P.rotate(np.repeat(mug.quaternion[:, None], 3, axis=1), offsets)[here],
            (cubes.positions - mug.position[:, None])[here],
            atol=1e-6,
        )
        assert not offsets[~here].any()
        assert obs[:, 51].tolist() == mug.present.tolist()
        assert env.step(np.zeros((8, 0))).info["is_success"].tolist() == (counts == 3).tolist()


def test_a_goal_above_an_object_knows_how_high_it_is(tmp_path: Path) -> None:
    command = {"goal": {"term": "goal_above", "surface": "mug", "height": 0.05}}
    with made(tmp_path, command=command) as env:
        env.reset(seed=0)
        env.scene.look(None)
        mug = ObjectView(env.scene, "mug")
        height = np.zeros(8)
        for entity, ids in mug.by_entity(np.arange(8)):
            height[ids] = 0.1 if entity.name.endswith("~0") else 0.3
        assert len(np.unique(height)) == 3
        assert np.allclose(env.scene.goals["goal"][:, 2], height + 0.05)


def test_an_event_reaches_what_is_there(tmp_path: Path) -> None:
    events = {"slick": {"term": "set_friction", "object": "mug", "friction": {"range": [0.1, 0.2]}}}
    with made(tmp_path, events=events) as env:
        env.reset(seed=0)
        index, presence = env.engine.index, env.engine.presence
        for e in env.engine.world.logical_objects["mug_0"].entities:
            values = env.engine.get_parameters("geom.friction", indices=index.geoms_of(env.engine.world.entities[e]))
            assert ((values < 0.2).all(axis=1) == presence[:, e]).all()


def test_what_is_the_same_in_every_env_costs_nothing(tmp_path: Path) -> None:
    with made(tmp_path) as env:
        assert isinstance(env.scene.frame("floor"), BodyFrame)  # the only one of its category
        assert isinstance(env.scene.frame("floor_0"), BodyFrame)
        assert isinstance(env.scene.frame("beads.4"), BodyFrame)


def test_names_that_are_wrong_are_explained(tmp_path: Path) -> None:
    with made(tmp_path, 1) as env:
        with pytest.raises(NameLookupError, match=r"there are 3 of 'cube'; say which: cube_0, cube_1, cube_2"):
            env.scene.frame("cube")
        with pytest.raises(NameLookupError, match="no category 'cubes'"):
            CategoryView(env.scene, "cubes")
        with pytest.raises(TaskError, match="'mug' can be mug_0~0, mug_0~1"):
            _ = ObjectView(env.scene, "mug").entity
    with pytest.raises(SpecError, match=r"'mug_0.nose' is not there in all .* mug_0~0, mug_0~1 have no such frame"):
        made(tmp_path, 1, observations={"policy": [{"term": "frame_pose", "frame": "mug.nose"}]})


def test_a_skill_finds_what_is_there_and_says_what_is_not() -> None:
    change = [
        "world.objects.cube.source={choice: [{box: [0.04, 0.04, 0.04]}, {sphere: 0.02}]}",
        "world.objects.cube.count={choice: [0, 1]}", "world.cameras.front.look_at=cube",
    ]  # fmt: skip
    with arm(8, *change) as env:
        env.reset(seed=0)
        policy = SkillPolicy(env)
        policy.begin(np.arange(8))
        there = ObjectView(env.scene, "cube")
        env.scene.look(None)
        present = there.present.copy()
        assert 0 < present.sum() < 8
        action = policy.act(np.arange(8))
        outcomes = [policy.describe(i)["outcome"] for i in range(8)]
        assert outcomes == ["running" if p else "adverse_state" for p in present]
        env.step(action)

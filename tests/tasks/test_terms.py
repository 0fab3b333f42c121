"""The term library `tasks`: coverage of a patch, commanded velocities and a latch, against what was worked out."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import SpecError
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.task.term_registry import bind
from anysim.testing.engines import require_engine
from tests.task.helpers import blocks
from tests.task.test_place_terms import put

DOG: dict[str, Any] = {
    "engine": "null",
    "world": {
        "name": "dog",
        "robots": {"dog": {"robot": "unitree_go1", "position": [0, 0, 0.4], "actions": {"base": "joint_velocity"}}},
    },
    "task": {
        "horizon": 200,
        "command": {
            "walk": {
                "term": "tasks.velocity",
                "every": 0.2,
                "forward": {"range": [-1.0, 1.0]},
                "turn": {"range": [-2.0, 2.0]},
            }
        },
        "observations": {"policy": [{"term": "tasks.goal_velocity", "goal": "walk"}]},
        "rewards": {"match": {"term": "tasks.velocity_match", "goal": "walk", "scale": 0.5}},
        "success": {"follows": {"term": "tasks.at_velocity", "goal": "walk", "reward": 100}},
    },
}
LATCHED: dict[str, Any] = {
    "world": {
        "name": "latched",
        "objects": {
            "door": {"source": "procedural:door", "fixed": True},
            "lever": {"source": {"procedural": "valve", "params": {"style": "lever"}}, "fixed": True},
        },
        "layout": {"door": {"position": [0.0, 0.0, 0.0]}, "lever": {"position": [2.0, 0.0, 0.0]}},
    },
    "task": {
        "horizon": 500,
        "observations": {"policy": [{"term": "object_joint_pos", "object": "door"}]},
        "events": {"bolt": {"term": "tasks.latch", "joint": "door.leaf", "by": "lever.wheel", "position": 0.4}},
    },
}
ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]


def over(env: TaskEnv, x: float, y: float, height: float = 0.0) -> None:
    """The ball over the table's middle, in a control step of its own."""
    env.scene.elapsed[:] += 1
    put(env, "ball", (x, y, 0.2 + height))


def test_coverage_is_what_the_tool_has_been_at() -> None:
    patch = {"tool": "ball", "b": "table", "size": [0.2, 0.1], "spacing": 0.05, "radius": 0.03}  # 4 x 2 markers
    with blocks() as env:
        env.reset(seed=0)
        half, more = (bind("predicate", "tasks.coverage", {**patch, "share": s}, env.scene, "t") for s in (0.5, 0.51))
        gain = bind("reward", "tasks.coverage_gain", patch, env.scene, "t")
        found: list[tuple[float, bool, bool]] = []
        for x, y, height in (
            (-0.075, -0.025, 0.0),
            (-0.075, -0.025, 0.0),
            (0.025, 0.0, 0.0),
            (0.075, 0.025, 0.04),
            (0.05, 0.025, 0.01),
        ):
            over(env, x, y, height)
            found.append((float(gain()[0]), bool(half()[0]), bool(more()[0])))
            assert gain().tolist() == [found[-1][0]]
        assert [share for share, _, _ in found] == [1 / 8, 0.0, 2 / 8, 0.0, 1 / 8]
        assert [said for _, said, _ in found] == [False, False, False, False, True]
        assert not any(said for _, _, said in found)
        env.reset(seed=0)
        over(env, 0.075, 0.025)
        assert (gain().tolist(), half().tolist()) == ([1 / 8], [False]), "an episode begins with a clean patch"


def test_coverage_counts_while_something_holds() -> None:
    gate = {"low": {"term": "below", "frame": "red", "height": 0.5}}
    with blocks() as env:
        env.reset(seed=0)
        params = {"tool": "ball", "b": "table", "size": [0.1, 0.1], "during": gate}
        gain = bind("reward", "tasks.coverage_gain", params, env.scene, "t")
        for height, said in ((0.6, False), (0.4, True)):
            put(env, "red", (0.0, 0.0, height))
            over(env, 0.0, 0.0)
            assert (gain()[0] > 0) == said


def test_a_velocity_is_drawn_again_after_so_many_seconds_and_can_be_drawn_anew() -> None:
    with anysim.make(DOG, num_envs=3) as env:
        obs, info = env.reset(seed=0)
        every = round(0.2 / env.engine.world.physics.control_dt)
        seen = [obs["policy"].copy()]
        middle = None
        for step in range(2 * every + 1):
            if step == every + 1:
                middle = env.snapshot()
            seen.append(env.step(np.zeros((3, env.action_dim))).obs["policy"].copy())
        assert all((row == seen[0]).all() for row in seen[:every])
        assert all((row == seen[every]).all() for row in seen[every : 2 * every])
        assert len({row[0, 0] for row in seen}) == 3
        assert (np.abs(seen[0]) <= [1.0, 0.0, 2.0]).all()
        assert middle is not None
        env.reset(seed=5)
        env.reset_to(middle)
        again = [env.step(np.zeros((3, env.action_dim))).obs["policy"] for _ in range(every)]
        assert all((a == b).all() for a, b in zip(again, seen[every + 2 :], strict=True))
        obs, _ = env.reset(episode_seeds=info["episode_seed"])
        assert (obs["policy"] == seen[0]).all()


def test_what_moves_as_it_is_told_to_is_rewarded() -> None:
    with anysim.make(DOG, num_envs=2) as env:
        env.reset(seed=0)
        env.scene.goals["walk"][:] = [0.6, 0.2, -0.5]
        root = env.engine.index.entity("dog").root
        heading = P.from_roll_pitch_yaw(np.array([[0.0, 0.0, 2.0]] * 2))
        pose = np.concatenate([[[0.0, 0.0, 0.4]] * 2, heading], axis=1)[:, None]
        own = np.array([[0.6, 0.2, 0.0], [0.6 - 0.3, 0.2, 0.0]])  # the second is 0.3 m/s too slow
        twist = np.concatenate([P.rotate(heading, own), [[0.0, 0.0, -0.5], [0.0, 0.0, -0.1]]], axis=1)[:, None]
        env.engine.set_body_state(pose, twist, None, [root])
        env.scene.look(None)
        for part, wrong in (("linear", 0.3), ("turn", 0.4)):
            params = {"goal": "walk", "part": part, "scale": 0.5}
            match = bind("reward", "tasks.velocity_match", params, env.scene, "t")()
            np.testing.assert_allclose(match, [1.0, np.exp(-((wrong / 0.5) ** 2))])
        for speed, rate, said in ((0.31, 0.41, True), (0.29, 0.41, False), (0.31, 0.39, False)):
            params = {"goal": "walk", "speed": speed, "rate": rate}
            assert bind("predicate", "tasks.at_velocity", params, env.scene, "t")().tolist() == [True, said]


def test_a_velocity_is_no_frame_and_a_pose_no_velocity() -> None:
    goal = {"there": {"term": "goal_at", "position": [1.0, 0.0, 0.0]}}
    task = {**DOG["task"], "command": {**DOG["task"]["command"], **goal}}
    for wrong, words in (
        (
            {"term": "tasks.goal_velocity", "goal": "there"},
            r"no commanded velocity 'there'.*commanded velocities: walk",
        ),
        ({"term": "frame_pose", "frame": "walk"}, r"no entity 'walk'.*Goals: there"),
    ):
        with pytest.raises(SpecError, match=words):
            anysim.make({**DOG, "task": {**task, "observations": {"policy": [wrong]}}})


@pytest.mark.parametrize("engine", ENGINES)
def test_a_latch_holds_a_door_until_its_lever_is_turned(engine: str) -> None:
    require_engine(engine)
    with anysim.make({**LATCHED, "engine": engine}, num_envs=2) as env:
        door, lever = env.engine.index.joint("door.leaf"), env.engine.index.joint("lever.wheel")
        own = env.engine.world.joints[door].friction

        def pushed(steps: int) -> np.ndarray:
            """The leaf, pushed open with 20 N m."""
            wrench = np.zeros((2, 1, 6))
            wrench[..., 5] = 20.0
            for _ in range(steps):
                env.engine.apply_wrench(wrench, [env.engine.index.body("door.leaf")])
                env.step(np.zeros((2, 0)))
            return env.engine.get_state().joint_pos[:, door].copy()

        for _ in range(2):
            env.reset(seed=0)
            assert (np.abs(pushed(50)) < 1e-3).all(), "it is held from the first step on"
            held = env.snapshot()
            env.engine.set_joint_state(np.array([[0.5]]), np.zeros((1, 1)), [1], [lever])
            opened = pushed(50)
            assert abs(opened[0]) < 1e-3
            assert opened[1] > 1.0
            env.engine.set_joint_state(np.array([[0.0]]), np.zeros((1, 1)), [1], [lever])
            pushed(2)
            friction = env.engine.get_parameters("joint.friction", indices=[door])[:, 0]
            np.testing.assert_allclose(friction, [500.0, own], err_msg="the bolt does not catch an open door")
        env.reset_to(held)
        assert (np.abs(pushed(5)) < 1e-3).all()

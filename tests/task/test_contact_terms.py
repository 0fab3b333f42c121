"""Terms of contact, effort and orientation, against weights and angles that are known."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.math import pose as P
from anysim.task.term_registry import bind
from anysim.testing.engines import require_engine
from tests.task.helpers import BLOCKS, blocks
from tests.task.test_place_terms import put

G = 9.81
WEIGHED: dict[str, Any] = {
    "world": {
        "name": "weighed",
        "objects": {
            "floor": {"source": {"box": [1.0, 1.0, 0.1]}, "fixed": True},
            "crate": {"source": {"box": [0.1, 0.1, 0.1]}, "mass": 0.5},
            "lid": {"source": {"box": [0.1, 0.1, 0.02]}, "mass": 0.2},
        },
        "layout": {
            "floor": {"position": [0.0, 0.0, 0.05]},
            "crate": {"position": [0.0, 0.0, 0.15]},
            "lid": {"position": [0.0, 0.0, 0.21]},
        },
        "contact_sensors": {
            "under": {"body": "crate", "against": "floor"},
            "over": {"body": "crate", "against": "lid"},
        },
    },
    "task": {
        "horizon": 200,
        "observations": {"policy": [{"term": "contact_force", "sensor": "under"}]},
        "rewards": {"weight": {"term": "contact_force", "sensor": "under", "limit": 10.0}},
        "failure": {"pressed": {"term": "force_over", "sensor": "under", "limit": 6.0, "steps": 5}},
    },
}


@pytest.mark.parametrize(
    "engine",
    ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)],
)
def test_what_rests_on_something_presses_on_it_with_its_weight(engine: str) -> None:
    require_engine(engine)
    with anysim.make({**WEIGHED, "engine": engine}, num_envs=1) as env:
        env.reset(seed=0)
        light, heavy = (
            bind("predicate", "touching", {"sensor": "over", "force": force}, env.scene, "t") for force in (1.5, 2.5)
        )
        gentle, firm = (
            bind("predicate", "touching", {"sensor": "over", "most": most}, env.scene, "t") for most in (2.2, 1.8)
        )
        between = bind("predicate", "grasped", {"left": "under", "right": "over"}, env.scene, "t")
        status: list[str] = []
        while not status or status[-1] == "running":
            result = env.step(np.zeros((1, 0)))
            status += result.status.tolist()
            if len(status) == 60:
                np.testing.assert_allclose(env.obs["policy"][0], [0.0, 0.0, 0.7 * G], atol=0.05)
                assert result.reward[0] == pytest.approx(0.7 * G / 10.0, abs=0.005)
                assert (light().tolist(), heavy().tolist()) == ([True], [False]), "the lid weighs 1.96 N"
                assert (gentle().tolist(), firm().tolist()) == ([True], [False])
                assert between().all(), "floor and lid press from opposite sides"
        assert status[-1] == "failed", "0.7 kg are more than 6 N for more than 5 steps"


@pytest.mark.parametrize(("turn", "symmetry", "angle"), [(0.3, 1, 0.3), (1.5, 4, np.pi / 2 - 1.5), (np.pi, 2, 0.0)])
def test_angles_know_symmetry(turn: float, symmetry: int, angle: float) -> None:
    with blocks() as env:
        env.reset(seed=0)
        put(env, "red", (0, 0, 0.5), (0.0, 0.0, turn))
        put(env, "ball", (0, 0, 0.6))
        frames = {"a": "red", "b": "ball"}
        found = bind("reward", "angle", {**frames, "symmetry": symmetry}, env.scene, "t")()
        np.testing.assert_allclose(found, angle, atol=1e-9)
        for tolerance, said in ((angle + 0.01, True), (max(angle - 0.01, 1e-6), angle < 1e-6)):
            params = {**frames, "tolerance": tolerance, "symmetry": symmetry}
            assert bind("predicate", "aligned", params, env.scene, "t")().tolist() == [said]
        assert bind("reward", "axis_angle", frames, env.scene, "t")() == pytest.approx(0.0, abs=1e-7)


def test_a_pose_in_another_frame_and_heights() -> None:
    with blocks() as env:
        env.reset(seed=0)
        put(env, "red", (0.1, 0.2, 0.5), (0.0, 0.0, np.pi / 2))
        put(env, "ball", (0.1, 0.3, 0.8), (0.0, 0.0, np.pi / 2), twist=(0.3, 0.0, 0.4, 0, 0, 0))
        relative = bind("observation", "relative_pose", {"a": "red", "b": "ball"}, env.scene, "t")()
        np.testing.assert_allclose(relative, [[0.1, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0]], atol=1e-12)
        assert bind("reward", "height", {"a": "ball", "b": "red"}, env.scene, "t")() == pytest.approx(0.3)
        assert bind("reward", "speed", {"frame": "ball"}, env.scene, "t")() == pytest.approx(0.5)
        near = {axes: {"a": "red", "b": "ball", "tolerance": 0.15, "axes": axes} for axes in ("xy", "z", "xyz")}
        said = {axes: bind("predicate", "near", params, env.scene, "t")().tolist() for axes, params in near.items()}
        assert said == {"xy": [True], "z": [False], "xyz": [False]}


def test_goals_have_orientations() -> None:
    goals = {
        "turned": {"term": "goal_pose", "position": [0.1, 0.0, 0.5], "yaw": {"range": [-1.0, 1.0]}},
        "beside": {"term": "goal_from", "frame": "table", "offset": [0.0, 0.2, 0.3], "yaw": 0.5},
    }
    task = {**BLOCKS["task"], "command": {**BLOCKS["task"]["command"], **goals}}
    with anysim.make({**BLOCKS, "task": task}, num_envs=8) as env:
        env.reset(seed=3)
        yaw = P.rotation_vector(env.scene.goals["turned"][:, 3:])[:, 2]
        assert np.abs(yaw).max() <= 1.0
        assert len(np.unique(yaw)) == 8
        beside = P.pose((0.0, 0.2, 0.5), P.from_roll_pitch_yaw(np.array([0.0, 0.0, 0.5])))
        np.testing.assert_allclose(env.scene.goals["beside"], np.tile(beside, (8, 1)), atol=1e-12)

"""Bodies that leave the world: a fault of their env alone, with a sentence."""

import numpy as np
import pytest

import anysim
from anysim.api import compile_world
from anysim.engine.extent import Extent
from anysim.task.env import TaskEnv
from tests.task.helpers import BLOCKS, blocks

NOTHING = np.zeros((3, 0))


def put(env: TaskEnv, row: int, height: float) -> None:
    red = env.engine.index.body("red")
    pose = env.engine.get_state().body_pose[:, red].copy()
    pose[row, 2] = height
    env.engine.set_body_state(pose[:, None], bodies=[red])


def test_a_body_that_leaves_faults_its_env_and_is_named() -> None:
    with blocks(3, "physics.extent=50") as env:
        env.reset(seed=0)
        put(env, 1, 60.0)
        result = env.step(NOTHING)
        assert result.info["fault"].tolist() == [False, True, False]
        assert result.status.tolist() == ["running", "failed", "running"]
        assert np.isnan(result.reward).tolist() == [False, True, False]
        reason = env.engine.fault_reason(1)
        assert reason.startswith("'red' has left the world at 0.020 s: it is at (")
        assert reason.endswith(", 60) m, beyond 50 m from the origin (physics.extent)")
        assert env.engine.fault_reason(0) == ""
        env.reset(mask=np.array([False, True, False]))
        assert not env.engine.get_state().fault.any()


def test_the_world_ends_somewhere_unless_told_otherwise() -> None:
    with blocks(3) as env:
        env.reset(seed=0)
        put(env, 0, 9_000.0)
        put(env, 2, -11_000.0)
        assert env.step(NOTHING).info["fault"].tolist() == [False, False, True]


def test_nothing_is_looked_at_where_nothing_can_leave() -> None:
    assert Extent(compile_world({"world": {"robots": {"panda": {"robot": "franka_panda"}}}})).watched is None
    assert Extent(compile_world({"world": BLOCKS["world"]})).watched == slice(1, 3)


@pytest.mark.parametrize("engine", ["mujoco"])
def test_what_falls_without_end_ends_as_a_fault(engine: str) -> None:
    spec = BLOCKS | {"engine": engine, "physics": {"extent": 5.0}, "task": BLOCKS["task"] | {"failure": {}}}
    with anysim.make(spec, overrides=["task.horizon=200", "world.layout.red={position: [3, 0, 0.5]}"]) as env:
        env.reset(seed=0)
        env.engine.set_body_state(twist=np.array([[[0, 0, 40.0, 0, 0, 0]]]), bodies=[env.engine.index.body("red")])
        for _ in range(20):
            result = env.step(NOTHING[:1])
            if result.info["fault"][0]:
                break
        assert result.info["fault"][0]
        assert "'red' has left the world at 0.1" in env.engine.fault_reason(0)

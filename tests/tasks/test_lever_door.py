"""A door with a lever and a latch: a spring brings the lever back, the latch holds the leaf until it is turned."""

from math import radians
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.conventions import Array
from anysim.errors import SpecError
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from tests.tasks.states import seen, set_joint

ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]
BOLT = {"term": "tasks.latch", "joint": "door.leaf", "by": "door.lever", "position": radians(25)}
SPRING = {"term": "tasks.spring", "joint": "door.lever", "stiffness": 1.0, "rest": -0.4, "when": "step"}


def lever_door(engine: str, **events: Any) -> TaskEnv:
    """The door alone, with events; nothing acts on it but them."""
    require_engine(engine)
    source = {"procedural": "door", "params": {"lever": radians(45)}}
    world = {
        "name": "lever_door",
        "objects": {"door": {"source": source, "fixed": True}},
        "layout": {"door": {"position": [0.0, 0.0, 0.0]}},
    }
    task = {
        "horizon": 500,
        "observations": {"policy": [{"term": "object_joint_pos", "object": "door"}]},
        "events": events,
    }
    return anysim.make({"world": world, "task": task, "engine": engine}, num_envs=2)


def hold(env: TaskEnv, *angles: float) -> None:
    """Hold the lever at an angle in each env, against its spring."""
    lever = [env.engine.index.joint("door.lever")]
    env.engine.set_joint_state(np.array(angles)[:, None], np.zeros((2, 1)), None, lever)
    env.engine.set_parameters("joint.friction", np.full((2, 1), 20.0), None, lever)


def let_go(env: TaskEnv) -> None:
    """Hold it no longer."""
    lever = env.engine.index.joint("door.lever")
    env.engine.set_parameters("joint.friction", np.full((2, 1), env.engine.world.joints[lever].friction), None, [lever])


def run(env: TaskEnv, steps: int, force: float = 0.0) -> Array:
    """Joints (N, 2) of leaf and lever after control steps with a force [N] at the handle, along the leaf's normal."""
    leaf, lever = env.engine.index.joint("door.leaf"), env.engine.index.joint("door.lever")
    body = env.engine.index.body("door.leaf")
    for _ in range(steps):
        hinge, handle = seen(env, "door.leaf"), seen(env, "door.leaf.handle")
        turn = env.engine.get_state().joint_pos[:, leaf]
        normal = np.stack([np.cos(turn), np.sin(turn), np.zeros(2)], axis=1)
        middle = env.engine.world.bodies[body].inertial
        assert middle is not None
        along = handle[:, :3] - hinge[:, :3]  # only what is along the leaf matters: the hinge carries the rest
        arm = np.linalg.norm(along[:, :2], axis=1) - abs(middle.com[1])
        wrench = np.zeros((2, 1, 6))
        wrench[:, 0, :3], wrench[:, 0, 5] = force * normal, force * arm
        env.engine.apply_wrench(wrench, [body])
        env.step(np.zeros((2, 0)))
    return env.engine.get_state().joint_pos[:, [leaf, lever]].copy()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_lever_comes_back_by_its_spring(engine: str) -> None:
    with lever_door(engine, back=SPRING) as sprung, lever_door(engine) as loose:
        for env in (sprung, loose):
            env.reset(seed=0)
            set_joint(env, "door.lever", 0.7)
        after = run(sprung, 50)
        assert (np.abs(after) < 0.01).all(), "the lever is level, and its spring moves no leaf"
        assert (run(loose, 50)[:, 1] > 0.69).all(), "without a spring it stays where it is"


@pytest.mark.parametrize("engine", ENGINES)
def test_the_leaf_opens_once_the_lever_is_turned_and_latches_again_when_closed(engine: str) -> None:
    with lever_door(engine, back=SPRING, bolt=BOLT) as env:
        env.reset(seed=0)
        assert (np.abs(run(env, 50, 50.0)[:, 0]) < 1e-3).all(), "50 N at the handle of a latched door"
        hold(env, radians(24), radians(26))
        opened = run(env, 20, 50.0)[:, 0]
        assert abs(opened[0]) < 1e-3
        assert opened[1] > 0.3
        let_go(env)
        shut = run(env, 250, -10.0)[:, 0]
        assert shut[1] < 0.02
        again = run(env, 50, 50.0)
        assert (np.abs(again[:, 0] - shut) < 1e-3).all(), "the bolt has caught it"
        assert (np.abs(again[:, 1]) < 0.01).all()
        hold(env, 0.0, radians(26))
        assert run(env, 20, 50.0)[1, 0] > 0.3, "and is drawn again"


def test_a_spring_at_a_slide_is_refused() -> None:
    world = {"objects": {"box": {"source": "procedural:cabinet", "fixed": True}}}
    task = {
        "observations": {"policy": [{"term": "object_joint_pos", "object": "box"}]},
        "events": {"back": SPRING | {"joint": "box.drawer_1"}},
    }
    with pytest.raises(SpecError, match=r"'box\.drawer_1' is not one joint that turns"):
        anysim.make({"world": world, "task": task})

"""A rope: how long and heavy it is, that it bends to all sides, and that it lies still on each engine."""

import numpy as np
import pytest

from anysim.api import make
from anysim.assets.procedural import build
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from tests.plugins.assets.test_procedural import complaints

ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]


def lying(engine: str, height: float, side: float = 0.3, **params: float) -> TaskEnv:
    """A rope that is bent into an arc, at a height above the ground."""
    require_engine(engine)
    rope = {"source": {"procedural": "rope", "params": params}, "joints": {"side_*": {"initial": side}}}
    world = {"terrain": {"kind": "plane"}, "objects": {"rope": rope}, "layout": {"rope": {"position": [0, 0, height]}}}
    task = {"observations": {"policy": [{"term": "object_joint_pos", "object": "rope"}]}}
    return make({"physics": {"dt": 0.002, "control_dt": 0.02}, "world": world, "task": task}, engine=engine, num_envs=1)


def test_it_has_the_length_and_the_mass_that_were_asked_for() -> None:
    params = {"length": 0.5, "radius": 0.008, "links": 9, "density": 800.0}
    model = build("rope", params)
    assert sum(body.inertial.mass for body in model.bodies if body.inertial) == pytest.approx(
        800.0 * np.pi * 0.008**2 * 0.5
    )
    assert [joint.name for joint in model.joints] == [name for k in range(1, 5) for name in (f"side_{k}", f"up_{k}")]
    with lying("null", 0.008, side=0.0, **params) as env:
        env.reset(seed=0)
        ends = [env.scene.frame(f"rope.{end}").pose[0, :3] for end in ("first", "middle", "last")]
    assert np.linalg.norm(ends[2] - ends[0]) == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
def test_it_keeps_its_bends_where_it_lies(engine: str) -> None:
    with lying(engine, 0.01) as env:
        env.reset(seed=0)
        before = env.engine.get_state().body_pose[0].copy()
        for _ in range(50):
            env.step(np.zeros((1, env.action_dim)))
        assert np.allclose(env.engine.get_state().body_pose[0, :, :3], before[:, :3], atol=2e-3)


@pytest.mark.parametrize("engine", ENGINES)
def test_it_falls_and_lies_flat(engine: str) -> None:
    """Dropped from 10 cm, it comes to rest on all of its rods."""
    with lying(engine, 0.1) as env:
        env.reset(seed=0)
        for _ in range(100):
            env.step(np.zeros((1, env.action_dim)))
        state = env.engine.get_state()
        assert np.allclose(state.body_pose[0, :, 2], 0.01, atol=2e-3)
        assert np.abs(state.body_twist[0]).max() < 0.05


def test_rods_too_short_are_refused() -> None:
    [text] = complaints(source={"procedural": "rope", "params": {"length": 0.1, "links": 40}})
    assert "shorter than half of the radius" in text

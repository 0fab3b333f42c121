"""A cart rolls as far as its friction and damping say, to both sides, and stands still where nothing moves it."""

import numpy as np
import pytest

from anysim.api import make
from anysim.assets.procedural import build
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from tests.plugins.assets.test_procedural import complaints

ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]
FRICTION, DAMPING = 3.0, 5.0
"""[N], [N s/m]: the builder's own."""


def standing(engine: str) -> TaskEnv:
    """A cart on a plane."""
    require_engine(engine)
    world = {
        "terrain": {"kind": "plane"},
        "objects": {"cart": {"source": "procedural:cart", "fixed": True}},
        "layout": {"cart": {"position": [0.0, 0.0, 0.0]}},
    }
    task = {"observations": {"policy": [{"term": "object_joint_pos", "object": "cart"}]}}
    return make({"physics": {"dt": 0.002, "control_dt": 0.02}, "world": world, "task": task}, engine=engine)


def rolled(mass: float, speed: float) -> float:
    """[m] until it stands, of m dv/dt = -(F + c v)."""
    time = mass / DAMPING * np.log1p(DAMPING * speed / FRICTION)
    return mass * speed / DAMPING - FRICTION / DAMPING * time


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("joint", ["along", "aside"])
def test_it_rolls_as_far_as_friction_and_damping_let_it(engine: str, joint: str) -> None:
    mass = [body.inertial.mass for body in build("cart", {}).bodies]
    with standing(engine) as env:
        env.reset(seed=0)
        number = env.engine.index.joint(f"cart.{joint}")
        env.engine.set_joint_state(np.zeros((1, 1)), np.full((1, 1), 0.8), None, [number])
        for _ in range(200):
            env.step(np.zeros((1, env.action_dim)))
        state = env.engine.get_state()
        moved = sum(mass[1:] if joint == "along" else mass[2:])
        assert state.joint_pos[0, number] == pytest.approx(rolled(moved, 0.8), rel=0.03)
        assert np.abs(state.joint_vel).max() < 1e-3
        others = np.delete(state.joint_pos[0], number)
        assert np.abs(others).max() < 5e-3  # what it weighs is not amid its casters


def test_its_bar_is_where_it_was_asked_for() -> None:
    sites = {site.name: site.position for site in build("cart", {"bar_height": 0.9, "deck": 0.25}).sites}
    assert sites["body.handle"] == pytest.approx((0.25 + 0.06, 0.0, 0.9))
    assert sites["body.deck"] == pytest.approx((0.0, 0.0, 0.25))


@pytest.mark.parametrize(
    ("params", "key"),
    [({"deck": 0.03}, "deck"), ({"bar_height": 0.3}, "bar_height"), ({"handle": {"length": 0.6}}, "handle")],
)
def test_what_does_not_fit_is_said_with_its_key(params: dict[str, object], key: str) -> None:
    [text] = complaints(source={"procedural": "cart", "params": params})
    assert text.startswith(f"objects.it.source.params.{key}: ")

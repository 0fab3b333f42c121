"""A rope against formulas, with the tolerances that the docs state."""

from typing import Any

import numpy as np
import pytest

from anysim_soft.rope import Rope
from tests.plugins.soft.softs import ALL, begun, run_of, wait, with_ball

HUNG = {"kind": "rope", "path": [[-0.4, 0.0, 0.0], [0.0, 0.0, -0.3], [0.4, 0.0, 0.0]], "position": [0.0, 0.0, 1.0]}


def catenary(length: float, span: float) -> float:
    """[m] how far a chain between two points at one height hangs down."""
    low, high = span / 100, 100 * span
    for _ in range(200):
        a = 0.5 * (low + high)
        low, high = (a, high) if 2 * a * np.sinh(span / (2 * a)) > length else (low, a)
    return a * (np.cosh(span / (2 * a)) - 1)


def test_it_hangs_as_a_catenary():
    """Sag within 1 %, the whole curve within 2 mm, longer by less than a thousandth."""
    with begun(run_of({**HUNG, "fixed": ["start", "end"], "drag": 2.0})) as (env, it):
        assert env.families.facts(0)["it"]["length"] == pytest.approx(1.0)
        wait(env, 200)
        x, sag = it.x[0], catenary(1.0, 0.8)
        assert 1.0 - x[:, 2].min() == pytest.approx(sag, rel=0.01)
        assert env.families.facts(0)["it"]["length"] == pytest.approx(1.0, abs=1e-3)
        a = 0.8**2 / (8 * sag)  # begin of the search for its parameter
        for _ in range(50):
            a *= (a * (np.cosh(0.4 / a) - 1) / sag) ** 0.9
        curve = 1.0 - sag + a * (np.cosh(x[:, 0] / a) - 1)
        assert np.abs(curve - x[:, 2]).max() < 2e-3
        assert env.families.facts(0)["it"]["mass"] == pytest.approx(1000 * np.pi * 0.005**2)


@pytest.mark.parametrize(
    "engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ("pybullet", "sapien"))]
)
def test_a_body_at_its_end_hangs_and_swings(engine):
    """A ball of 0.5 kg at a rope of 0.5 m swings with the period of a pendulum, and pulls with its weight at rest."""
    rope = {
        "kind": "rope",
        "path": [[0.0, 0.0, 0.0], [0.05, 0.0, -0.4975]],
        "position": [0.0, 0.0, 1.0],
        "segments": 10,
    }
    rope |= {"fixed": ["start"], "attached": {"end": "ball"}, "density": 500.0}
    with begun(run_of(rope, engine, with_ball([0.05, 0.0, 1.0 - 0.4975], 0.02, 0.5))) as (env, it):
        xs = []
        for _ in range(100):
            wait(env)
            xs.append(env.engine.get_state().body_pose[0, it.met[0], 0])
        turns = np.flatnonzero((np.array(xs[:-1]) > 0) & (np.array(xs[1:]) <= 0))
        assert (turns[0] + 1) * 0.02 * 4 == pytest.approx(2 * np.pi * np.sqrt(0.5 / 9.81), rel=0.06)
        pull = it.body_force(ALL)[0, 0, :3]
        assert np.linalg.norm(pull) == pytest.approx(0.5 * 9.81, rel=0.05)
        end = it.x[0, -1] - env.engine.get_state().body_pose[0, it.met[0], :3]
        assert np.abs(end).max() < 2e-3
        assert isinstance(it, Rope)
        assert it.carries(0) > 20


@pytest.mark.slow
def test_it_lies_over_a_bar_and_does_not_fall_through():
    world = {"objects": {"bar": {"source": {"box": [0.04, 0.4, 0.04]}, "fixed": True}}}
    world["layout"] = {"bar": {"position": [0.0, 0.0, 0.4]}}
    rope = {"kind": "rope", "path": [[-0.3, 0.0, 0.0], [0.3, 0.0, 0.0]], "position": [0.0, 0.0, 0.45]}
    with begun(run_of(rope, world=world)) as (env, it):
        wait(env, 50)
        x = it.x[0]
        inside = (np.abs(x[:, 0]) < 0.02) & (x[:, 2] < 0.42) & (x[:, 2] > 0.38)
        assert not inside.any()
        assert x[:, 2].max() > 0.42


def test_a_hand_that_closes_holds_a_rope_feels_its_weight_and_is_remembered():
    """Nothing is lost between hand and rope; a snapshot goes on with the same point; it falls when the hand opens."""
    pad = {"tool": "panda.tool", "joint": "panda.panda_finger_joint1", "closed": 0.025, "reach": 0.05, "points": 1}
    panda = {"robot": "franka_panda", "actions": {"arm": "joint_delta_position", "eef": "gripper_binary"}}
    rope = {"kind": "rope", "path": [[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]], "segments": 8, "density": 800.0, "drag": 3.0}
    rope |= {"radius": 0.008, "pads": {"hand": pad}}
    with begun(run_of(rope, world={"robots": {"panda": panda}})) as (env, _):
        tool = env.scene.frame("panda.tool").position[0].tolist()
    with begun(run_of({**rope, "position": tool}, world={"robots": {"panda": panda}})) as (env, it):
        close, pulls = np.array([[0.0] * 7 + [-1.0]]), []
        for step in range(100):
            env.step(close)
            if step >= 80:
                pulls.append(it.pads.force[0, 0])
        pads: Any = env.families.facts(0)["it"]["pads"]
        assert pads["hand"]["stage"] == "holding"
        found = it.balance(ALL)
        assert np.abs((found.now - found.begun - found.received + found.given)[:, :3]).max() < 1e-9
        assert np.mean(pulls) == pytest.approx(it.mass(0) * 9.81, rel=0.1)
        snapshot = env.snapshot()
        env.step(close)
        expected = it.x.copy()
        env.reset(seed=5)
        env.reset_to(snapshot)
        env.step(close)
        assert np.array_equal(it.x, expected)
        held, along = (env.families.state("it").fields[key][0] for key in ("held", "along"))
        assert held.sum() == 1
        assert np.allclose(along, np.linspace(0.0, 0.2, 9))
        for _ in range(40):
            env.step(-close)
        assert not env.families.state("it").fields["held"].any()
        assert it.x[..., 2].max() < tool[2] - 0.1

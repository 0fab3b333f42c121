"""Momentum that matter and bodies trade: none is lost, and engines agree."""

import numpy as np
import pytest

from anysim.testing.engines import require_engine
from tests.plugins.particles.matters import ENGINES, begun, in_tank, run_of, wait

EXACT = {"mujoco": 1e-6, "pybullet": 1e-6, "sapien": 1e-5}
ALL = np.array([0])


def _thrown(engine: str, kind: str) -> tuple[float, float]:
    """Linear momentum that is lost, and that is traded, where a block of matter is hit without weight [N s]."""
    require_engine(engine)
    matter = {"kind": kind, "box": [0.05, 0.05, 0.05]} | ({"radius": 0.004} if kind == "sand" else {})
    ball = {"source": {"sphere": 0.04}, "mass": 0.2}
    world = {"objects": {"ball": ball}, "layout": {"ball": {"position": [0.2, 0.01, 0.53]}}}
    matter["position"] = [0.0, 0.0, 0.5]
    run = run_of(matter, engine, world, gravity=[0.0, 0.0, 0.0])
    with begun(run) as (env, it):
        body = int(it.met[0])
        env.engine.set_body_state(twist=[[[-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]]], bodies=[body], pose=None)
        wait(env, 20)
        ours = it.momentum(ALL)[0, :3]
        theirs = 0.2 * (env.engine.get_state().body_twist[0, body, :3] - [-1.0, 0.0, 0.0])
        assert np.abs(it.received).max() == 0.0
        return float(np.abs(ours + theirs).max()), float(np.abs(theirs).max())


@pytest.mark.parametrize("kind", ["fluid", pytest.param("sand", marks=pytest.mark.slow)])
@pytest.mark.parametrize("engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ENGINES[1:])])
def test_bodies_get_what_matter_loses(engine, kind):
    lost, traded = _thrown(engine, kind)
    assert traded > 0.02
    assert lost <= EXACT[engine] * traded


@pytest.mark.slow
def test_one_drop_on_three_engines():
    """A box that falls into water and floats: the same path within 1 mm for half a second."""
    box = {"source": {"box": [0.05, 0.05, 0.05]}, "density": 400.0}
    world = in_tank(0.1, 0.25, box=(box, [0.0, 0.0, 0.14]))
    paths = {}
    for engine in ENGINES:
        require_engine(engine)
        with begun(run_of({"kind": "fluid", "box": [0.1, 0.1, 0.08]}, engine, world)) as (env, it):
            path = []
            for _ in range(25):
                wait(env)
                path.append(env.engine.get_state().body_pose[0, it.met[0], :3].copy())
            paths[engine] = np.array(path)
    assert np.ptp(paths["mujoco"][:, 2]) > 0.02
    for engine in ENGINES[1:]:
        assert np.abs(paths[engine] - paths["mujoco"]).max() < 1e-3, engine


def test_a_body_of_joints_moves_matter_and_feels_it():
    """The door of a cabinet, swung by its speed through sand: an impulse against its motion, and none is lost."""
    world = {
        "objects": {"arm": {"source": {"procedural": "hinge_box"}}},
        "layout": {"arm": {"position": [0.0, 0.0, 0.2]}},
    }
    pytest.importorskip("anysim_assets")
    matter = {"kind": "sand", "box": [0.06, 0.06, 0.06], "radius": 0.005, "position": [0.0, 0.0, 0.45]}
    with begun(run_of(matter, world=world)) as (env, it):
        assert not env.engine.world.loose[it.met].all()
        wait(env, 15)
        found = it.balance(ALL)
        assert np.abs(found.given[0, :3]).max() > 0
        lost = found.now - found.begun - found.received + found.given
        assert np.abs(lost[0, :3]).max() < 1e-9 * np.abs(found.received[0, :3]).max()

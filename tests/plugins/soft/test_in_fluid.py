"""A balloon in water, and a body that touches matter and something that the engine holds: what they trade."""

from typing import Any

import numpy as np
import pytest

from anysim.testing.engines import require_engine
from anysim_particles.bench import tank
from anysim_soft.inflatable import Inflatable
from tests.plugins.soft.softs import ALL, ENGINES, begun, run_of, wait

EXACT = {"mujoco": 1e-6, "pybullet": 1e-6, "sapien": 1e-5}
EACH = pytest.mark.parametrize("engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ENGINES[1:])])
BALLOON = {"kind": "inflatable", "radius": 0.05, "subdivisions": 1, "pressure": 500.0}
WATER = {"kind": "fluid", "spacing": 0.0125}


def run_with(balloon: dict[str, Any], water: dict[str, Any], engine: str = "mujoco", **physics: Any) -> dict[str, Any]:
    """A run that watches the balloon `it` in a tank, and `water`."""
    run = run_of({**BALLOON, **balloon}, engine, tank(0.16, 0.16), **physics)
    run["world"]["families"]["water"] = {**WATER, **water}
    return run


@EACH
@pytest.mark.parametrize("first", ["it", pytest.param("water", marks=pytest.mark.slow)])
def test_water_that_hits_a_balloon_loses_what_that_gets(engine: str, first: str) -> None:
    """Without weight, and far from everything else: all that there is of momentum is theirs."""
    require_engine(engine)
    water = {"box": [0.05, 0.075, 0.075], "position": [-0.1, 0.0, 0.5]}
    run = run_with({"position": [0.0, 0.0, 0.49]}, water, engine, gravity=[0.0, 0.0, 0.0])
    families = run["world"]["families"]
    run["world"]["families"] = {name: families[name] for name in sorted(families, key=lambda name: name != first)}
    with begun(run) as (env, it):
        fluid = env.families.family("water")
        fluid.v[0, :, 0] = 1.0
        begin = fluid.momentum(ALL)[0, :3] + it.momentum(ALL)[0, :3]
        wait(env, 8)
        end, got = fluid.momentum(ALL)[0, :3] + it.momentum(ALL)[0, :3], it.momentum(ALL)[0, 0]
        assert got > 0.01
        assert np.abs(end - begin).max() <= EXACT[engine] * got


@pytest.mark.slow
def test_it_floats_as_deep_as_its_weight_asks_for() -> None:
    """Within one spacing; and each account of momentum is kept."""
    with begun(run_with({"density": 4000.0, "position": [0.0, 0.0, 0.07]}, {"box": [0.16, 0.16, 0.0625]})) as (env, it):
        assert isinstance(it, Inflatable)
        fluid, drafts = env.families.family("water"), []
        wait(env, 40)
        for _ in range(10):
            wait(env)
            low, level = it.x[0, :, 2].min() - 0.003, np.quantile(fluid.x[0, :, 2], 0.97) + 0.00625
            drafts.append(level - low)
        radius = (3 * it.volume(0) / (4 * np.pi)) ** (1 / 3) + 0.003
        depths = np.linspace(0.0, 2 * radius, 2000)
        expected = depths[np.argmax(np.pi * depths**2 * (3 * radius - depths) / 3 * 1000.0 > it.mass(0))]
        assert np.mean(drafts) == pytest.approx(expected, abs=0.0125)
        for family in (it, fluid):
            account = family.balance(ALL)
            lost = (account.now - account.begun - account.received + account.given)[0, :3]
            assert np.abs(lost).max() < 1e-9


@pytest.mark.slow
def test_it_goes_on_from_a_snapshot_in_the_middle_of_a_splash() -> None:
    """In another env, and beside one that is reset."""
    run = run_with({"position": [0.0, 0.0, 0.07]}, {"box": [0.16, 0.16, 0.05], "density": {"range": [900, 1100]}})
    with begun(run, num_envs=2) as (env, it):
        wait(env, 4)
        assert isinstance(it, Inflatable)
        assert it.due.any()
        snapshot = env.snapshot()
        wait(env, 3)
        expected = [x[:1].tobytes() for x in env.families.snapshot(np.arange(2)).values()]
    with begun(run, num_envs=2, seed=5) as (env, it):
        env.reset_to(snapshot)
        wait(env)
        env.reset(mask=np.array([False, True]))
        wait(env, 2)
        assert [x[:1].tobytes() for x in env.families.snapshot(np.arange(2)).values()] == expected


@EACH
def test_a_body_on_a_block_and_on_a_sponge_gets_all_that_it_gets(engine: str) -> None:
    """A board that the engine holds at one end and soft matter at the other: all forces together give its motion."""
    require_engine(engine)
    world = {
        "objects": {
            "block": {"source": {"box": [0.1, 0.2, 0.1]}, "fixed": True},
            "board": {"source": {"box": [0.4, 0.1, 0.02]}, "mass": 0.5},
        },
        "layout": {"block": {"position": [-0.15, 0.0, 0.05]}, "board": {"position": [0.0, 0.0, 0.112]}},
        "contact_sensors": {"felt": {"body": "board"}},
    }
    sponge = {"kind": "deformable", "box": [0.1, 0.1, 0.1], "young": 2e4, "position": [0.15, 0.0, 0.001]}
    run = run_of(sponge, engine, world, control_dt=0.004)
    with begun(run) as (env, it):
        rows, body = [], int(it.met[0])
        for _ in range(60):
            before = env.engine.get_state().body_twist[0, body, 2]
            wait(env)
            state = env.engine.get_state()
            given, held = it.body_force(ALL)[0, 0, 2], state.contact_force[0, 0, 2]
            rows.append((0.5 * (state.body_twist[0, body, 2] - before) / 0.004, given, held))
        gained, given, held = np.array(rows).T
        assert given.max() > 0.5
        assert held.max() > 0.5
        # PhysX and Bullet tell of what contacts gave with the precision of their solvers
        room = {"mujoco": 1e-6, "pybullet": 0.02, "sapien": 0.02}[engine]
        assert np.abs(gained - (given + held - 0.5 * 9.81)).max() <= room * (given.max() + held.max())
        account = it.balance(ALL)
        lost = (account.now - account.begun - account.received + account.given)[0, :3]
        assert np.abs(lost).max() <= EXACT[engine] * np.abs(account.given[0, :3]).max()

"""Fire and flow: their laws, the drag of bodies, images that see them, recordings, refusals at their lines."""

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.record.reader import open_trajectory
from anysim.record.replay import replay
from anysim.testing.engines import require_drawing, require_engine
from anysim_fields.fire import Fire
from anysim_fields.flow import Flow
from anysim_fields.kernels.air import air_velocity, climb_time, jet_speed, plume_speed, plume_warmth
from anysim_fields.kernels.haze import haze
from anysim_recording.collector import Collector
from tests.contract.suite_runs import run
from tests.plugins.fields.worlds import ALL, ENGINES, balls, begun, run_of, wait
from tests.schemas.test_every_key import Still

EACH = pytest.mark.parametrize("engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ENGINES[1:])])
WEIGHTLESS = {"gravity": [0.0, 0.0, 0.0]}
FIRE = {"kind": "fire", "power": 20e3, "radius": 0.1, "puffs": 240, "lifetime": 1.5}
SMOKE = {"kind": "flow", "speed": 1.0, "radius": 0.03, "emission": 1e-4, "puffs": 60, "lifetime": 2.0}


def air(place, heat=0.0, speed=0.0, radius=0.05, wind=(0.0, 0.0, 0.0)):
    out = np.zeros(3)
    up = np.array([0.0, 0.0, 1.0])
    air_velocity(np.array(place, dtype=float), np.zeros(3), up, np.array(wind), heat, speed, radius, out)
    return out


def test_a_plume_is_mccaffreys_and_a_jet_falls_as_one_over_the_distance():
    assert plume_speed(32e3, 0.2) == pytest.approx(6.8 * 0.2**0.5)
    assert plume_speed(32e3, 0.5) == pytest.approx(1.9 * 32**0.2)
    assert plume_speed(8e3, 2.0) / plume_speed(8e3, 16.0) == pytest.approx(2.0)
    assert plume_speed(8e3, 4.0) / plume_speed(1e3, 4.0) == pytest.approx(2.0)
    assert plume_warmth(20e3, 0.1) == pytest.approx(852, rel=0.01)
    assert plume_warmth(1e3, 1.0) / plume_warmth(1e3, 2.0) == pytest.approx(2 ** (5 / 3))
    heights = np.linspace(1e-6, 2.0, 200_001)
    middles = (heights[1:] + heights[:-1]) / 2
    took = sum(1 / plume_speed(5e3, z) for z in middles) * (heights[1] - heights[0])
    assert climb_time(5e3, 2.0) == pytest.approx(took, rel=2e-3)
    assert jet_speed(3.0, 0.05, 0.3) == 3.0
    assert jet_speed(3.0, 0.05, 2.0) == pytest.approx(3.0 * 6.06 * 0.1 / 2.0)
    assert air([0.094 * 2.0, 0, 2.0], speed=3.0)[2] == pytest.approx(0.5 * air([0, 0, 2.0], speed=3.0)[2])
    assert air([0.12 * 2.0, 0, 2.0], heat=5e3)[2] == pytest.approx(0.5 * air([0, 0, 2.0], heat=5e3)[2])


@pytest.mark.parametrize("source", [{"heat": 5e3}, {"speed": 3.0}])
def test_air_that_a_plume_or_a_jet_gains_comes_in_from_the_sides(source):
    """The divergence is nothing beside the slopes, wherever it is looked at beyond the source."""
    for place in ([0.05, 0.02, 1.5], [0.2, -0.1, 1.2], [0.4, 0.3, 2.0]):
        h, slopes = 1e-4, []
        for axis in range(3):
            step = np.zeros(3)
            step[axis] = h
            slopes.append((air(place + step, **source)[axis] - air(place - step, **source)[axis]) / (2 * h))
        assert abs(sum(slopes)) < 2e-3 * max(map(abs, slopes))


def test_the_light_through_a_bell_is_what_its_integral_says():
    """A puff 2 m away: exp(-tau) through its middle, half of tau where something stands in its middle, none before."""
    point, amount, size = np.array([[0.0, 0.0, 2.0]]), np.array([0.3]), np.array([0.2])

    def left(depth):
        seen = np.ones((1, 1))
        image = np.full((1, 1), depth, dtype=np.float32)
        none = np.zeros((0, 0, 3), dtype=np.uint8), np.zeros((0, 0), dtype=np.int32)
        rest = seen, np.zeros((1, 1)), np.zeros((1, 1, 3)), image
        haze(point, size, amount, np.zeros((1, 3)), np.array([0]), 100.0, 0.01, 7, *rest, *none)
        return -np.log(seen[0, 0])

    tau = 0.3 / (2 * np.pi * 0.2**2)
    assert left(100.0) == pytest.approx(tau, rel=1e-6)
    assert left(2.0) == pytest.approx(tau / 2, rel=1e-6)
    assert left(1.0) < 1e-5 * tau


def test_a_puff_in_wind_goes_with_it_and_spreads_by_diffusion():
    """No heat and no jet: the middle moves with the wind, the variance grows by 2 D t, and no smoke is lost."""
    wind = {**SMOKE, "speed": 0.0, "wind": [0.5, -0.2, 0.0], "diffusion": 0.01, "position": [0, 0, 1.0]}
    with begun(run_of(wind)) as (env, it):
        assert isinstance(it, Flow)
        wait(env, 40)
        there = it.puffs.there(ALL)[0]
        age, x, size = it.puffs.age[0, there], it.puffs.x[0, there], it.puffs.size[0, there]
        assert len(age) == 24
        assert np.abs(x - age[:, None] * [0.5, -0.2, 0.0] - [0, 0, 1.0]).max() < 0.031
        np.testing.assert_allclose(size**2 - 2 * 0.01 * age, 0.009**2, rtol=1e-9)
        assert it.puffs.mass[0, there].sum() == pytest.approx(1e-4 * 0.8, rel=0.03)
        assert it.facts(0)["it"]["mass"] == pytest.approx(1e-4 * 0.8, rel=0.03)


@EACH
def test_wind_carries_a_ball_by_the_law_of_drag(engine):
    """Without weight, from rest: v = U k U t / (1 + k U t) with k = rho C A / 2 m; the other ball stays."""
    require_engine(engine)
    u, area, mass = 4.0, 0.0012, 0.004
    world = balls((0, 0, 1.0), (0, 1.0, 1.0), mass=mass)
    flow = {"kind": "flow", "wind": [u, 0, 0], "emission": 0.0, "drag": {"a": {"area": area}}}
    with begun(run_of(flow, engine, world, **WEIGHTLESS)) as (env, it):
        wait(env, 50)
        k = 1.2 * 0.47 * area / (2 * mass)
        twist = env.engine.get_state().body_twist[0]
        assert twist[it.met[0], 0] == pytest.approx(u * k * u / (1 + k * u), rel=2e-3)
        assert not twist[it.engine.world.entities[it.engine.world.entity_numbers["b"]].root].any()
        assert it.balance(ALL).given[0, 0] == pytest.approx(mass * twist[it.met[0], 0], rel=1e-5)


def test_a_fan_pushes_the_less_the_farther_and_a_source_goes_with_its_body():
    world = balls((0, 0, 0.5), (0, 0, 1.5), (0.3, 0, 0.2), mass=0.05)
    drag = {"a": {"area": 0.001}, "b": {"area": 0.001}}
    fan = {"kind": "flow", "speed": 5.0, "radius": 0.05, "at": "c", "position": [-0.3, 0, -0.2], "drag": drag}
    with begun(run_of(fan, world=world, **WEIGHTLESS)) as (env, it):
        assert isinstance(it, Flow)
        wait(env)
        force = it.body_force(ALL)[0, :, 2]
        law = [0.5 * 1.2 * 0.47 * 0.001 * (5.0 * min(1.0, 6.06 * 0.1 / z)) ** 2 for z in (0.5, 1.5)]
        np.testing.assert_allclose(force, law, rtol=2e-3)
        c = it.engine.world.entities[it.engine.world.entity_numbers["c"]].root
        env.engine.set_body_state(pose=[[[1.3, 0, 0.2, 0, 0, 0, 1]]], bodies=[c])
        wait(env)
        where: Any = it.facts(0)["it"]["where"]
        np.testing.assert_allclose(where, [1.0, 0.0, 0.0], atol=1e-9)
        assert np.abs(it.body_force(ALL)).max() < 1e-6


def test_a_flame_is_as_high_as_its_power_says_and_swings_about_that():
    with begun(run_of({**FIRE, "radius": 0.05}, "null")) as (env, it):
        assert isinstance(it, Fire)
        height = 0.235 * 20**0.4 - 1.02 * 0.1
        assert it.height(ALL)[0] == pytest.approx(height)
        tips, tops = [], []
        for _ in range(100):
            wait(env)
            tips.append(it.tip(ALL)[0])
            state = it.state(ALL)
            burning = state.fields["burning"][0]
            tops.append(state.points[0, burning, 2].max() if burning.any() else 0.0)
        assert np.mean(np.array(tips) > height) == pytest.approx(0.5, abs=0.07)
        assert np.mean(tops[20:]) == pytest.approx(height, rel=0.2)
        facts = it.facts(0)["it"]
        assert facts["burning"] is True
        assert facts["flame_height"] == pytest.approx(height)
        soot = state.fields["mass"][0, state.fields["there"][0]].sum()
        assert soot == pytest.approx(20e3 / 12.4e6 * 0.015 * 1.5, rel=0.02)
        it.put_out(ALL)
        wait(env, 30)
        assert it.facts(0)["it"]["burning"] is False
        assert not it.burning(ALL).any()


def test_a_fire_grows_with_the_square_of_time_reaches_what_is_in_it_and_is_lit_where_it_is():
    world = balls((0, 0, 0.2), (1.0, 0, 0.2))
    with begun(run_of({**FIRE, "growth": 1.0, "lit": {"choice": [True, False]}}, "null", world), 6, seed=3) as (
        env,
        it,
    ):
        assert isinstance(it, Fire)
        lit = it.lit.copy()
        assert 0 < lit.sum() < 6
        wait(env, 25)
        power = it.power(np.arange(6))
        np.testing.assert_allclose(power, np.where(lit, 20e3 * 0.25, 0.0), rtol=1e-9)
        one = int(np.flatnonzero(lit)[0])
        assert it.facts(one)["it"]["reaches"] == ["a"]
        it.light(np.flatnonzero(~lit))
        wait(env, 1)
        assert (it.power(np.arange(6)) > 0).all()


@EACH
def test_images_see_fire_and_smoke_and_what_hides_them(engine):
    """A post in front is seen as it is, one behind through the flame, and the id is the family's where it is thick."""
    require_drawing(engine)
    post = {"source": {"box": [0.03, 0.03, 1.0]}, "fixed": True, "color": "blue"}
    camera = {
        "look_at": [0, 0, 0.2],
        "from": [0.0, -1.5, 0.25],
        "size": [64, 48],
        "channels": ["rgb", "depth", "segmentation"],
    }
    world = {
        "objects": {"near": post},
        "layout": {"near": {"position": [0.0, -0.5, 0.5]}},
        "cameras": {"front": camera},
    }
    with begun(run_of({**FIRE, "radius": 0.15}, engine, world)) as (env, it):
        channels = ("rgb", "depth", "segmentation")
        before = env.engine.render("front", channels=channels)
        wait(env, 10)
        after = env.engine.render("front", channels=channels)
        ids = after["segmentation"][0]
        mine = it.setting.entities[0] + 1
        assert (ids == mine).sum() > 30
        glow = after["rgb"][0][ids == mine].astype(float).mean(axis=0)
        assert glow[0] > 1.5 * glow[2]
        depth = after["depth"][0][ids == mine]
        assert depth.min() > 1.5 - 0.45
        assert depth.max() < 1.5 + 0.45
        hidden = before["segmentation"][0] == 1 + [e.name for e in env.engine.world.entities].index("near")
        assert hidden.sum() > 30
        assert (ids[hidden] != mine).all()
        changed = np.abs(after["rgb"][0][hidden].astype(int) - before["rgb"][0][hidden])
        assert changed.max() <= 8


def test_recordings_replay_and_stream_points(tmp_path: Path):
    made: dict[str, Any] = run_of(SMOKE)
    made["world"]["families"]["fire"] = FIRE
    made |= {"record": {"keep": "all", "streams": {"matter": {"fps": 25}}}}
    made["task"]["horizon"] = 8
    with anysim.make(made, num_envs=2) as env:
        list(Collector(env, Still(env), tmp_path, 2, seed=1).run())
    for folder in sorted((tmp_path / "episodes").iterdir()):
        reader = open_trajectory(folder)
        assert len(reader.stream("matter/fire").values[-1]) > 1
        assert reader.states_from_reset("family_it_mass")[-1] > 0
        assert replay(folder).identical


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", ["fire", "flow"])
def test_the_suite_clears_it(engine, kind, tmp_path: Path):
    """Snapshots, partial resets and steps to the bit, with everything drawn; a flow that pushes the ball."""
    require_engine(engine)
    options: dict[str, Any] = {
        "fire": {"power": {"range": [5e3, 2e4]}, "radius": {"range": [0.05, 0.1]}, "growth": 0.2, "puffs": 60},
        "flow": {
            "wind": {"range": [[-1, 0, 0], [1, 1, 0]]},
            "speed": 2.0,
            "drag": {"ball": {"area": 0.03}},
            "puffs": 60,
        },
    }[kind]
    words = ["-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "--pyargs", "anysim.testing.families"]
    words += ["--family", kind, "--engine", engine]
    words += [w for key, value in options.items() for w in ("--family-option", f"{key}={json.dumps(value)}")]
    done = run(*words, folder=tmp_path)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    passed = {"fire": "8 passed, 2 skipped", "flow": "9 passed, 1 skipped"}[kind]
    assert re.search(passed, done.stdout), sys.version


def test_parameters_are_drawn_by_env():
    low, high = {"range": [0.1, 0.2]}, {"range": [[0, 0, 0], [0.1, 0.2, 0.3]]}
    of_both = {"radius": low, "turbulence": low, "diffusion": low, "position": high, "wind": high, "puffs": 10}
    kinds: dict[str, dict[str, Any]] = {
        "fire": {"power": {"range": [1e3, 2e3]}, "soot": low, "flicker": low, "growth": low},
        "flow": {"speed": low, "heat": low, "emission": low, "direction": high, "fluid_density": low}
        | {"extinction": low, "settling": low, "drag": {"a": {"area": low, "coefficient": low}}},
    }
    for kind, more in kinds.items():
        world = balls((0, 0, 1.0))
        with begun(run_of({"kind": kind, **of_both, **more}, world=world), num_envs=3, seed=4) as (_, it):
            for key in (*of_both, *more):
                if key != "puffs":
                    rows = it.memory["drag_area" if key == "drag" else "axis" if key == "direction" else key]
                    assert len({row.tobytes() for row in rows}) == 3, key


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"sped": 1.0}, r"families\.it\.sped.*did you mean 'speed'"),
        ({"speed": -1.0}, r"families\.it\.speed"),
        ({"at": "nobody"}, r"families\.it\.at: there is no body or object 'nobody'"),
        (
            {"drag": {"wall": {"area": 0.1}}},
            r"families\.it\.drag\.wall: '.*' has no shape that collides or does not move",
        ),
        ({"look": "fog"}, r"families\.it\.look"),
    ],
)
def test_what_cannot_be_is_refused(change, words):
    world = balls((0, 0, 1.0))
    world["objects"]["wall"] = {"source": {"box": [0.1, 0.1, 0.1]}, "fixed": True}
    world["layout"]["wall"] = {"position": [1, 0, 0.05]}
    with pytest.raises(anysim.errors.AnysimError, match=words):
        anysim.make(run_of({**SMOKE, **change}, world=world)).close()

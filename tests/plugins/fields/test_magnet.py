"""Magnets: the law of dipoles, what they trade, what they do to bodies on engines, refusals at their lines."""

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.math import pose as P
from anysim.testing.engines import require_engine
from anysim_fields.kernels.dipoles import MU0, interact
from tests.contract.suite_runs import run
from tests.plugins.fields.worlds import ALL, ENGINES, balls, begun, run_of, wait

EACH = pytest.mark.parametrize("engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.slow) for e in ENGINES[1:])])
WEIGHTLESS = {"gravity": [0.0, 0.0, 0.0]}


def law(place, moment, near=0.0, uniform=(0.0, 0.0, 0.0), induced=None, reach=np.inf):
    """Field, force and torque (D, 3), and the moments."""
    d = len(place)
    moment = np.array(moment, dtype=float)
    found = [np.zeros((d, 3)) for _ in range(3)]
    radius, there = np.full(d, near / 2), np.ones(d, dtype=bool)
    induced = np.zeros(d) if induced is None else np.array(induced, dtype=float)
    interact(np.array(place, dtype=float), moment, induced, radius, there, np.array(uniform), reach, *found)
    return (*found, moment)


def energy(place, moment, near):
    """[J] of two, by the formula itself outside of `near`."""
    r = np.array(place[0]) - np.array(place[1])
    a, b, at = np.array(moment[0]), np.array(moment[1]), np.linalg.norm(r)
    k = MU0 / (4 * np.pi)
    if at >= near:
        return k * (a @ b / at**3 - 3 * (a @ r) * (b @ r) / at**5)
    f = near**-3 - 1.5 * near**-5 * (at**2 - near**2)
    g = near**-5 - 2.5 * near**-7 * (at**2 - near**2)
    return k * (f * (a @ b) - 3 * g * (a @ r) * (b @ r))


def test_two_on_an_axis_attract_by_the_fourth_power_and_side_by_side_repel():
    m, r = 1.3, 0.07
    _, force, torque, _ = law([[0, 0, r], [0, 0, 0]], [[0, 0, m], [0, 0, m]])
    assert force[1, 2] == pytest.approx(3 * MU0 * m**2 / (2 * np.pi * r**4), rel=1e-12)
    assert not torque.any()
    _, force, _, _ = law([[r, 0, 0], [0, 0, 0]], [[0, 0, m], [0, 0, m]])
    assert force[0, 0] == pytest.approx(3 * MU0 * m**2 / (4 * np.pi * r**4), rel=1e-12)


def test_one_across_another_is_turned_by_its_field():
    m, r = 0.8, 0.05
    field, _, torque, _ = law([[0, 0, r], [0, 0, 0]], [[m, 0, 0], [0, 0, m]])
    axial = MU0 * m / (2 * np.pi * r**3)
    assert field[0, 2] == pytest.approx(axial, rel=1e-12)
    assert torque[0, 1] == pytest.approx(-m * axial, rel=1e-12)
    _, _, torque, _ = law([[0, 0, 0], [9, 9, 9]], [[m, 0, 0], [0, 0, 0]], uniform=(0.0, 0.02, 0.0))
    assert torque[0] == pytest.approx([0, 0, 0.02 * m], rel=1e-12)


@pytest.mark.parametrize("away", [0.03, 0.0199, 0.012, 0.001])
def test_forces_are_the_slope_of_the_energy_even_too_near(away):
    rng = np.random.default_rng(5)
    moment, unit, near = rng.normal(size=(2, 3)), rng.normal(size=3), 0.02
    place = np.array([away * unit / np.linalg.norm(unit), [0.0, 0.0, 0.0]])
    _, force, torque, _ = law(place, moment, near)
    step, slope = 1e-7, np.zeros(3)
    for axis in range(3):
        up, down = place.copy(), place.copy()
        up[0, axis], down[0, axis] = up[0, axis] + step, down[0, axis] - step
        slope[axis] = -(energy(up, moment, near) - energy(down, moment, near)) / (2 * step)
    np.testing.assert_allclose(force[0], slope, rtol=1e-5, atol=1e-5 * np.abs(slope).max())
    np.testing.assert_allclose(force[1], -force[0], rtol=0, atol=0)
    turned = torque.sum(axis=0) + np.cross(place, force).sum(axis=0)
    assert np.abs(turned).max() < 1e-13 * np.abs(torque).max()


def test_forces_are_continuous_where_the_tangent_begins_and_end_at_a_range():
    moment = [[0.3, 0.1, 1.0], [0.2, -0.4, 0.9]]
    just = [law([[0, 0, 0.02 + d], [0, 0, 0]], moment, 0.02)[1][0] for d in (-1e-9, 1e-9)]
    np.testing.assert_allclose(just[0], just[1], rtol=1e-5)
    assert not law([[0, 0, 0], [0, 0, 0]], moment, 0.02)[1].any()
    assert not law([[0, 0, 0.2], [0, 0, 0]], moment, reach=0.1)[1].any()


def test_iron_is_drawn_to_a_magnet_by_the_seventh_power():
    m, radius = 1.0, 0.01
    share = 4 * np.pi / MU0 * radius**3 * 999 / 1002
    pulls = []
    for r in (0.1, 0.2):
        _, force, _, moment = law([[0, 0, r], [0, 0, 0]], [[0, 0, 0], [0, 0, m]], induced=[share, 0])
        induced = share * MU0 * m / (2 * np.pi * r**3)
        assert moment[0, 2] == pytest.approx(induced, rel=1e-9)
        assert force[1, 2] == pytest.approx(3 * MU0 * m * induced / (2 * np.pi * r**4), rel=1e-9)
        pulls.append(force[1, 2])
    assert pulls[0] / pulls[1] == pytest.approx(2**7, rel=1e-9)


def test_iron_magnetises_iron():
    """Two equal balls in a field along their line: m = s B / (1 - 2 s k / r^3)."""
    share, r, b = 8.0, 0.025, 0.01
    _, _, _, moment = law([[0, 0, r], [0, 0, 0]], np.zeros((2, 3)), uniform=(0.0, 0.0, b), induced=[share, share])
    expected = share * b / (1 - 2 * share * MU0 / (4 * np.pi) / r**3)
    np.testing.assert_allclose(moment[:, 2], expected, rtol=1e-12)


def thrown(engine):
    """Momentum and angular momentum before and after two magnets flew past each other, and what was traded."""
    require_engine(engine)
    world = balls((0.0, 0.0, 1.0), (0.12, 0.03, 1.02), mass=0.2)
    magnets = {
        "kind": "magnet",
        "dipoles": {
            "one": {"body": "a", "moment": [0.0, 3.0, 4.0], "position": [0.005, 0.0, 0.0]},
            "two": {"body": "b", "moment": [4.0, 0.0, 3.0]},
        },
    }
    with begun(run_of(magnets, engine, world, **WEIGHTLESS)) as (env, it):
        env.engine.set_body_state(
            twist=[[[0.1, 0.2, 0.0, 0.0, 0.0, 1.0], [-0.1, 0.0, 0.1, 0.0, 2.0, 0.0]]], bodies=it.met
        )
        inertia = 0.4 * 0.2 * 0.02**2

        def total():
            state = env.engine.get_state()
            pose, twist = state.body_pose[0, it.met], state.body_twist[0, it.met]
            turning = 0.2 * np.cross(pose[:, :3], twist[:, :3]) + inertia * twist[:, 3:]
            return np.concatenate([0.2 * twist[:, :3].sum(axis=0), turning.sum(axis=0)])

        before = total()
        wait(env, 6)
        return before, total(), np.abs(it.given[0]).max(axis=0), it.balance(ALL)


@EACH
def test_momentum_and_angular_momentum_are_kept(engine):
    """To 1e-9 of what was traded on engines of double precision, to 1e-5 on SAPIEN."""
    before, after, traded, found = thrown(engine)
    assert traded[:3].max() > 0.003
    assert traded[3:].max() > 0.003
    exact = 1e-5 if engine == "sapien" else 1e-9
    assert np.abs(after - before)[:3].max() < exact * traded[:3].max()
    assert np.abs(after - before)[3:].max() < exact * traded[3:].max()
    lost = found.now - found.begun - found.received + found.given
    assert np.abs(lost).max() < 1e-12 * traded.max()


@EACH
def test_a_magnet_over_another_weighs_less_and_one_beside_another_turns(engine):
    """An engine accelerates as the law says, and a compass swings at the rate of a pendulum."""
    require_engine(engine)
    m, r, mass = 2.0, 0.12, 0.1
    world = balls((0.0, 0.0, 1.0), mass=mass)
    up = {"body": "a", "moment": [0, 0, m]}
    magnets = {"kind": "magnet", "dipoles": {"low": up, "high": {"position": [0, 0, 1.0 + r], "moment": [0, 0, m]}}}
    with begun(run_of(magnets, engine, world, control_dt=0.004)) as (env, it):
        wait(env)
        pull = 3 * MU0 * m**2 / (2 * np.pi * r**4)
        speed = env.engine.get_state().body_twist[0, it.met[0], 2]
        assert speed == pytest.approx((pull / mass - 9.81) * 0.004, rel=1e-5)
        assert it.received[0, 2] == pytest.approx(pull * 0.004, rel=1e-9)
    inertia, field = 0.4 * mass * 0.02**2, 0.002
    compass = {"kind": "magnet", "dipoles": {"needle": up}, "field": [field * np.sin(0.05), 0.0, field * np.cos(0.05)]}
    with begun(run_of(compass, engine, world, dt=0.001, control_dt=0.005, **WEIGHTLESS)) as (env, it):
        period = 2 * np.pi * np.sqrt(inertia / (m * field))
        wait(env, round(period / 2 / 0.005))
        needle = P.rotate(env.engine.get_state().body_pose[0, it.met[0], 3:], np.array([0.0, 0.0, 1.0]))
        assert np.arcsin(needle[0]) == pytest.approx(0.1, abs=0.002)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_the_suite_clears_it(engine, tmp_path: Path):
    """A magnet on the ball beside one that is fixed: snapshots, partial resets and steps, and what is lost."""
    require_engine(engine)
    one = {"body": "ball", "moment": {"range": [[0, 0, 1], [2, 0, 3]]}, "radius": 0.1}
    dipoles = json.dumps({"one": one, "two": {"moment": [0, 0, 9], "position": [0.6, 0, 0.4]}})
    words = ["-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "--pyargs", "anysim.testing.families"]
    words += ["--family", "magnet", "--engine", engine, "--family-option", f"dipoles={dipoles}"]
    done = run(*words, folder=tmp_path)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    assert re.search(r"9 passed, 1 skipped", done.stdout), sys.version


def test_parameters_are_drawn_by_env_and_an_electromagnet_is_switched():
    magnets = {
        "kind": "magnet",
        "field": {"range": [[0, 0, -1e-4], [0, 0, 1e-4]]},
        "dipoles": {
            "coil": {
                "position": {"range": [[0, 0, 1.1], [0, 0, 1.2]]},
                "moment": {"range": [[0, 0, 10], [0, 0, 20]]},
                "strength": {"choice": [0.5, 1.0]},
                "radius": {"range": [0.01, 0.03]},
            },
            "ball": {"body": "a", "radius": 0.02, "permeability": {"range": [100, 1000]}},
        },
    }
    with begun(run_of(magnets, world=balls((0, 0, 1.0)), **WEIGHTLESS), num_envs=3, seed=4) as (env, it):
        for key in ("position", "moment", "radius", "permeability", "uniform"):
            assert len({row.tobytes() for row in it.memory[key]}) == 3, key
        assert set(it.strength[:, 0]) <= {0.5, 1.0}
        it.strength[1, 0] = 0.0
        wait(env)
        force = env.families.state("it").fields["force"]
        assert force[[0, 2], 1, 2].min() > 1e-5
        assert abs(force[1, 1, 2]) < 1e-12
        facts: Any = env.families.facts(1)["it"]["dipoles"]
        assert facts["coil"]["on"] is False
        assert facts["ball"]["body"] == "a"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"momnt": [0, 0, 1]}, r"families\.it\.dipoles\.one\.momnt.*did you mean 'moment'"),
        ({"body": "nobody"}, r"families\.it\.dipoles\.one\.body: there is no body or object 'nobody'"),
        ({"moment": [0, 0, 0]}, r"families\.it\.dipoles\.one.*needs a `moment`"),
        ({"permeability": 0.5}, r"families\.it\.dipoles\.one\.permeability"),
    ],
)
def test_what_cannot_be_is_refused(change, words):
    magnets = {"kind": "magnet", "dipoles": {"one": {"body": "a", "moment": [0, 0, 1], **change}}}
    with pytest.raises(anysim.errors.AnysimError, match=words):
        anysim.make(run_of(magnets, world=balls((0, 0, 1)))).close()


def test_an_engine_without_wrenches_refuses_it():
    with pytest.raises(anysim.errors.AnysimError, match="external wrenches"):
        anysim.make(run_of({"kind": "magnet", "dipoles": {"one": {"moment": [0, 0, 1]}}}, "null")).close()
